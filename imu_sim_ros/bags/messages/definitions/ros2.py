# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The ROS 2 message definitions that this package writes: those of Jazzy, without comments.

Only the fields and constants count; the types' hashes (RIHS01, REP-2011) are those of Jazzy.
"""

from typing import Final

from imu_sim_ros.bags.messages.definitions import gps, livox

TEXTS: Final[dict[str, str]] = {
    **gps.ROS2,
    **livox.ROS2,
    "builtin_interfaces/Time": ("int32 sec\nuint32 nanosec\n"),
    "geometry_msgs/Point": ("float64 x\nfloat64 y\nfloat64 z\n"),
    "geometry_msgs/Point32": ("float32 x\nfloat32 y\nfloat32 z\n"),
    "geometry_msgs/Pose": ("geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    "geometry_msgs/PoseStamped": ("std_msgs/Header header\ngeometry_msgs/Pose pose\n"),
    "geometry_msgs/PoseWithCovariance": ("geometry_msgs/Pose pose\nfloat64[36] covariance\n"),
    "geometry_msgs/Quaternion": ("float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"),
    "geometry_msgs/Transform": (
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
    ),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"
    ),
    "geometry_msgs/Twist": ("geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n"),
    "geometry_msgs/TwistWithCovariance": ("geometry_msgs/Twist twist\nfloat64[36] covariance\n"),
    "geometry_msgs/TwistWithCovarianceStamped": (
        "std_msgs/Header header\ngeometry_msgs/TwistWithCovariance twist\n"
    ),
    "geometry_msgs/Vector3": ("float64 x\nfloat64 y\nfloat64 z\n"),
    "geometry_msgs/Vector3Stamped": ("std_msgs/Header header\ngeometry_msgs/Vector3 vector\n"),
    "nav_msgs/Odometry": (
        "std_msgs/Header header\n"
        "string child_frame_id\n"
        "geometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist\n"
    ),
    "rosgraph_msgs/Clock": ("builtin_interfaces/Time clock\n"),
    "sensor_msgs/CameraInfo": (
        "std_msgs/Header header\n"
        "uint32 height\n"
        "uint32 width\n"
        "string distortion_model\n"
        "float64[] d\n"
        "float64[9] k\n"
        "float64[9] r\n"
        "float64[12] p\n"
        "uint32 binning_x\n"
        "uint32 binning_y\n"
        "sensor_msgs/RegionOfInterest roi\n"
    ),
    "sensor_msgs/ChannelFloat32": ("string name\nfloat32[] values\n"),
    "sensor_msgs/CompressedImage": ("std_msgs/Header header\nstring format\nuint8[] data\n"),
    "sensor_msgs/FluidPressure": (
        "std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance\n"
    ),
    "sensor_msgs/Image": (
        "std_msgs/Header header\n"
        "uint32 height\n"
        "uint32 width\n"
        "string encoding\n"
        "uint8 is_bigendian\n"
        "uint32 step\n"
        "uint8[] data\n"
    ),
    "sensor_msgs/Imu": (
        "std_msgs/Header header\n"
        "geometry_msgs/Quaternion orientation\n"
        "float64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\n"
        "float64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\n"
        "float64[9] linear_acceleration_covariance\n"
    ),
    "sensor_msgs/JointState": (
        "std_msgs/Header header\nstring[] name\n"
        "float64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    ),
    "sensor_msgs/MagneticField": (
        "std_msgs/Header header\n"
        "geometry_msgs/Vector3 magnetic_field\n"
        "float64[9] magnetic_field_covariance\n"
    ),
    "sensor_msgs/NavSatFix": (
        "uint8 COVARIANCE_TYPE_UNKNOWN=0\n"
        "uint8 COVARIANCE_TYPE_APPROXIMATED=1\n"
        "uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2\n"
        "uint8 COVARIANCE_TYPE_KNOWN=3\n"
        "std_msgs/Header header\n"
        "sensor_msgs/NavSatStatus status\n"
        "float64 latitude\n"
        "float64 longitude\n"
        "float64 altitude\n"
        "float64[9] position_covariance\n"
        "uint8 position_covariance_type\n"
    ),
    "sensor_msgs/NavSatStatus": (
        "int8 STATUS_UNKNOWN=-2\n"
        "int8 STATUS_NO_FIX=-1\n"
        "int8 STATUS_FIX=0\n"
        "int8 STATUS_SBAS_FIX=1\n"
        "int8 STATUS_GBAS_FIX=2\n"
        "uint16 SERVICE_UNKNOWN=0\n"
        "uint16 SERVICE_GPS=1\n"
        "uint16 SERVICE_GLONASS=2\n"
        "uint16 SERVICE_COMPASS=4\n"
        "uint16 SERVICE_GALILEO=8\n"
        "int8 status\n"
        "uint16 service\n"
    ),
    "sensor_msgs/PointCloud": (
        "std_msgs/Header header\n"
        "geometry_msgs/Point32[] points\n"
        "sensor_msgs/ChannelFloat32[] channels\n"
    ),
    "sensor_msgs/PointCloud2": (
        "std_msgs/Header header\n"
        "uint32 height\n"
        "uint32 width\n"
        "sensor_msgs/PointField[] fields\n"
        "bool is_bigendian\n"
        "uint32 point_step\n"
        "uint32 row_step\n"
        "uint8[] data\n"
        "bool is_dense\n"
    ),
    "sensor_msgs/PointField": (
        "uint8 INT8=1\n"
        "uint8 UINT8=2\n"
        "uint8 INT16=3\n"
        "uint8 UINT16=4\n"
        "uint8 INT32=5\n"
        "uint8 UINT32=6\n"
        "uint8 FLOAT32=7\n"
        "uint8 FLOAT64=8\n"
        "string name\n"
        "uint32 offset\n"
        "uint8 datatype\n"
        "uint32 count\n"
    ),
    "sensor_msgs/RegionOfInterest": (
        "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"
    ),
    "sensor_msgs/Temperature": ("std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n"),
    "tf2_msgs/TFMessage": ("geometry_msgs/TransformStamped[] transforms\n"),
    "std_msgs/Header": ("builtin_interfaces/Time stamp\nstring frame_id\n"),
}
"""Definition of each type by name, without the types that it contains."""

RIHS01: Final[dict[str, str]] = {
    **gps.RIHS01,
    **livox.RIHS01,
    "geometry_msgs/TwistWithCovarianceStamped": (
        "RIHS01_77b67434531e6529b7a0091357b186b6ebdb17fd9ffd3e0c7ce9d3fb11a44563"
    ),
    "geometry_msgs/PoseStamped": (
        "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"
    ),
    "geometry_msgs/Vector3Stamped": (
        "RIHS01_d4829622288cbb443886e7ea94ea5671a3b1be6bab4ad04224432a65f7d7887a"
    ),
    "nav_msgs/Odometry": (
        "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"
    ),
    "rosgraph_msgs/Clock": (
        "RIHS01_692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"
    ),
    "sensor_msgs/CameraInfo": (
        "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275"
    ),
    "sensor_msgs/CompressedImage": (
        "RIHS01_15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a"
    ),
    "sensor_msgs/FluidPressure": (
        "RIHS01_22dfb2b145a0bd5a31a1ac3882a1b32148b51d9b2f3bab250290d66f3595bc32"
    ),
    "sensor_msgs/Image": (
        "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"
    ),
    "sensor_msgs/Imu": ("RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"),
    "sensor_msgs/JointState": (
        "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
    ),
    "sensor_msgs/MagneticField": (
        "RIHS01_e80f32f56a20486c9923008fc1a1db07bbb273cbbf6a5b3bfa00835ee00e4dff"
    ),
    "sensor_msgs/NavSatFix": (
        "RIHS01_62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404"
    ),
    "sensor_msgs/PointCloud": (
        "RIHS01_614593df71d3c2b9bd4604a71b750fd218f0d65c045ea988b713719455a65b3b"
    ),
    "sensor_msgs/PointCloud2": (
        "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"
    ),
    "sensor_msgs/Temperature": (
        "RIHS01_72514a14126ab9f8a9abec974c78e5610a367b59db5da355ff1fb982d5bad4b8"
    ),
    "tf2_msgs/TFMessage": (
        "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
    ),
}
"""Hash of each type that is written as a message."""
