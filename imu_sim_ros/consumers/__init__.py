# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The configuration files of each stack beside a bag; one module per stack.

A stack's module turns the values of an IMU, and of the cameras beside it, into the text of its
files. Continuous-time densities (kalibr, OpenVINS, ORB_SLAM3, Basalt) and values per sample (VINS,
imu_utils) are mixed up again and again; each file says what its numbers mean, whether it is whole
or a fragment to paste, and which simulated terms its format cannot express.

May import the leaves and bags (folders and decimal numbers).
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.consumers import kalibr as kalibr
    from imu_sim_ros.consumers.folder import write_all as write_all
    from imu_sim_ros.consumers.rig import RigValues as RigValues
    from imu_sim_ros.consumers.start import Start as Start
    from imu_sim_ros.consumers.start import start_warnings as start_warnings
    from imu_sim_ros.consumers.values import ImuValues as ImuValues
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "": ["kalibr"],
            "folder": ["write_all"],
            "rig": ["RigValues"],
            "start": ["Start", "start_warnings"],
            "values": ["ImuValues"],
        },
    )
