# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Images that exist already: of a bag into a dataset's folder, and of a folder into a bag.

``of_bag`` takes them out of messages, ``of_folder`` makes messages of files, ``files`` finds
them, ``description`` is what a dataset says about a camera. What it exports is imported when first
used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.datasets.recorded.of_bag import RecordedImages as RecordedImages
    from imu_sim_ros.datasets.recorded.of_bag import pixels as pixels
    from imu_sim_ros.datasets.recorded.of_bag import recorded_cameras as recorded_cameras
    from imu_sim_ros.datasets.recorded.of_bag import to_root as to_root
    from imu_sim_ros.datasets.recorded.of_folder import FolderImages as FolderImages
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "of_bag": ["RecordedImages", "pixels", "recorded_cameras", "to_root"],
            "of_folder": ["FolderImages"],
        },
    )
