# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Output of a simulation: bags, text datasets, and what its cameras see.

``topics`` holds the IMU's samples and the truth, ``tracks`` the features of cameras as tables,
``images`` their images as files, ``frames`` and ``features`` both as messages, ``camera_bag`` these
in a bag, ``vio_data_simulation`` the text files of the simulator of that name, ``tum_vi`` the
folder of that dataset; ``columns`` are the tables, ``read_tracks`` reads some of them back,
``recorded`` takes images out of a bag, or of a folder into one. One home for ``generate``, the
public interface and campaigns. Imports bags, topics, sensor, camera. What it exports is imported
when first used.
"""

from typing import TYPE_CHECKING

from imu_sim_ros.lazy import exported

if TYPE_CHECKING:
    from imu_sim_ros.datasets.camera_bag import CameraBag as CameraBag
    from imu_sim_ros.datasets.features import FeatureStream as FeatureStream
    from imu_sim_ros.datasets.frames import CameraMessages as CameraMessages
    from imu_sim_ros.datasets.frames import camera_topics as camera_topics
    from imu_sim_ros.datasets.frames import image_topic as image_topic
    from imu_sim_ros.datasets.frames import imagers as imagers
    from imu_sim_ros.datasets.frames import info_of_camera as info_of_camera
    from imu_sim_ros.datasets.frames import landmarks as landmarks
    from imu_sim_ros.datasets.images import ImageFolders as ImageFolders
    from imu_sim_ros.datasets.read_tracks import TrackFolder as TrackFolder
    from imu_sim_ros.datasets.read_tracks import read_track_folder as read_track_folder
    from imu_sim_ros.datasets.recorded import FolderImages as FolderImages
    from imu_sim_ros.datasets.recorded import RecordedImages as RecordedImages
    from imu_sim_ros.datasets.recorded import recorded_cameras as recorded_cameras
    from imu_sim_ros.datasets.topics import BagTarget as BagTarget
    from imu_sim_ros.datasets.topics import DatasetTarget as DatasetTarget
    from imu_sim_ros.datasets.topics import body_of as body_of
    from imu_sim_ros.datasets.topics import chosen_topics as chosen_topics
    from imu_sim_ros.datasets.topics import imus_of as imus_of
    from imu_sim_ros.datasets.topics import in_tables as in_tables
    from imu_sim_ros.datasets.topics import offered as offered
    from imu_sim_ros.datasets.topics import resolved as resolved
    from imu_sim_ros.datasets.topics import sensors as sensors
    from imu_sim_ros.datasets.tracks import TrackFiles as TrackFiles
    from imu_sim_ros.datasets.tum_vi import TumVi as TumVi
    from imu_sim_ros.datasets.vio_data_simulation import VioDataSimulation as VioDataSimulation
else:
    __getattr__, __dir__, __all__ = exported(
        __name__,
        {
            "camera_bag": ["CameraBag"],
            "features": ["FeatureStream"],
            "frames": [
                "CameraMessages",
                "camera_topics",
                "image_topic",
                "imagers",
                "info_of_camera",
                "landmarks",
            ],
            "images": ["ImageFolders"],
            "read_tracks": ["TrackFolder", "read_track_folder"],
            "recorded": ["FolderImages", "RecordedImages", "recorded_cameras"],
            "topics": [
                "BagTarget",
                "DatasetTarget",
                "body_of",
                "chosen_topics",
                "imus_of",
                "in_tables",
                "offered",
                "resolved",
                "sensors",
            ],
            "tracks": ["TrackFiles"],
            "tum_vi": ["TumVi"],
            "vio_data_simulation": ["VioDataSimulation"],
        },
    )
