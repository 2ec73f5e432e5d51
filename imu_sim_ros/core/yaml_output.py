# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""YAML of parameter files and of the metadata of bags."""


def as_yaml(content: object, flow_style: bool | None = False) -> str:
    """Return a value as YAML, with keys in their order.

    :param content: plain types, and lists and dictionaries of them; no key is empty.
    :param flow_style: True: everything in brackets; None: lists and dictionaries of plain values.
    """
    import yaml

    dumper: type[yaml.SafeDumper | yaml.CSafeDumper] = yaml.SafeDumper
    content_text = repr(content)
    # Without what has to be escaped, libyaml writes the same text in a tenth of the time.
    if content_text.isascii() and "\\" not in content_text and yaml.__with_libyaml__:
        dumper = yaml.CSafeDumper
    return str(yaml.dump(content, Dumper=dumper, sort_keys=False, default_flow_style=flow_style))
