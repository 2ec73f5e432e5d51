"""Every parameter once: frozen dataclasses, and the files that set them."""
