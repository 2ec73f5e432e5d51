# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as bytes: layouts, definitions, encoding and decoding of whole blocks.

Works on arrays of bytes, never on files. Imports the leaves.
"""

from imu_sim_ros.bags.messages import schemas
from imu_sim_ros.bags.messages.blocks import (
    Column,
    MessageBlock,
    Pattern,
    Payloads,
    Times,
    TopicInfo,
    as_list,
    as_pattern,
    side_by_side,
)
from imu_sim_ros.bags.messages.decode import (
    Decoded,
    MessageDecoder,
    decode_block,
    inside_order,
    transcode,
)
from imu_sim_ros.bags.messages.encode import (
    CLOCK,
    FLUID_PRESSURE,
    IMU,
    MAGNETIC_FIELD,
    NAV_SAT_FIX,
    ODOMETRY,
    POSE_STAMPED,
    TEMPERATURE,
    VECTOR3_STAMPED,
    ClockEncoder,
    FluidPressureEncoder,
    ImuEncoder,
    MagneticFieldEncoder,
    NavSatFixEncoder,
    OdometryEncoder,
    PoseStampedEncoder,
    TemperatureEncoder,
    Vector3StampedEncoder,
    divided,
)
from imu_sim_ros.bags.messages.gated import MessageGate
from imu_sim_ros.bags.messages.images import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    CameraInfo,
    CameraInfoEncoder,
    CompressedImageEncoder,
    ImageEncoder,
    Stamped,
)
from imu_sim_ros.bags.messages.installed import BrokenMessageError, recorded_type
from imu_sim_ros.bags.messages.layouts import STAMP_OFFSET, Bytes
from imu_sim_ros.bags.messages.point_clouds import (
    POINT_CLOUD,
    POINT_CLOUD2,
    PointCloud2Encoder,
    PointCloudEncoder,
)
from imu_sim_ros.bags.messages.qos import Qos, parse_qos, qos_profiles, qos_text
from imu_sim_ros.bags.messages.schemas import Schema, ros1_name, ros2_name, schema
from imu_sim_ros.bags.messages.transforms import TF_MESSAGE, TransformsEncoder

__all__ = [
    "CAMERA_INFO",
    "CLOCK",
    "COMPRESSED_IMAGE",
    "FLUID_PRESSURE",
    "IMAGE",
    "IMU",
    "MAGNETIC_FIELD",
    "NAV_SAT_FIX",
    "ODOMETRY",
    "POINT_CLOUD",
    "POINT_CLOUD2",
    "POSE_STAMPED",
    "STAMP_OFFSET",
    "TEMPERATURE",
    "TF_MESSAGE",
    "VECTOR3_STAMPED",
    "BrokenMessageError",
    "Bytes",
    "CameraInfo",
    "CameraInfoEncoder",
    "ClockEncoder",
    "Column",
    "CompressedImageEncoder",
    "Decoded",
    "FluidPressureEncoder",
    "ImageEncoder",
    "ImuEncoder",
    "MagneticFieldEncoder",
    "MessageBlock",
    "MessageDecoder",
    "MessageGate",
    "NavSatFixEncoder",
    "OdometryEncoder",
    "Pattern",
    "Payloads",
    "PointCloud2Encoder",
    "PointCloudEncoder",
    "PoseStampedEncoder",
    "Qos",
    "Schema",
    "Stamped",
    "TemperatureEncoder",
    "Times",
    "TopicInfo",
    "TransformsEncoder",
    "Vector3StampedEncoder",
    "as_list",
    "as_pattern",
    "decode_block",
    "divided",
    "inside_order",
    "parse_qos",
    "qos_profiles",
    "qos_text",
    "recorded_type",
    "ros1_name",
    "ros2_name",
    "schema",
    "schemas",
    "side_by_side",
    "transcode",
]
