# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arguments and printing; one file per program.

``common`` is what every program does, ``shared`` what several do. Sees every room. Nothing is
imported before a program asks for it: signals are handled first.
"""
