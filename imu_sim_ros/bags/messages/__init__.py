"""What messages look like as bytes: layouts, definitions, encoding and decoding of whole blocks."""
