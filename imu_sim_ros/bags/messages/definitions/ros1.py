# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# ruff: noqa: E501 - the lines of the definitions are as long as their authors made them
"""The text of the ROS 1 message definitions that this package writes.

ROS 1 tools compare the text of a definition in a bag with their own, comments included, so the
texts are verbatim: std_msgs 0.5.13, common_msgs 1.13.1 and rosgraph_msgs 1.11.3,
Copyright 2008-2010 Willow Garage, Inc., BSD-3-Clause.
"""

from typing import Final

from imu_sim_ros.bags.messages.definitions import gps, livox

# A line is a literal of its own because trailing blanks belong to the text.
TEXTS: Final[dict[str, str]] = {
    "geometry_msgs/Point": (
        "# This contains the position of a point in free space\nfloat64 x\nfloat64 y\nfloat64 z\n"
    ),
    "geometry_msgs/Pose": (
        "# A representation of pose in free space, composed of position and orientation. \n"
        "Point position\n"
        "Quaternion orientation\n"
    ),
    "geometry_msgs/PoseStamped": (
        "# A Pose with reference coordinate frame and timestamp\nHeader header\nPose pose\n"
    ),
    "geometry_msgs/PoseWithCovariance": (
        "# This represents a pose in free space with uncertainty.\n"
        "\n"
        "Pose pose\n"
        "\n"
        "# Row-major representation of the 6x6 covariance matrix\n"
        "# The orientation parameters use a fixed-axis representation.\n"
        "# In order, the parameters are:\n"
        "# (x, y, z, rotation about X axis, rotation about Y axis, rotation about Z axis)\n"
        "float64[36] covariance\n"
    ),
    "geometry_msgs/Quaternion": (
        "# This represents an orientation in free space in quaternion form.\n"
        "\n"
        "float64 x\n"
        "float64 y\n"
        "float64 z\n"
        "float64 w\n"
    ),
    "geometry_msgs/Twist": (
        "# This expresses velocity in free space broken into its linear and angular parts.\n"
        "Vector3  linear\n"
        "Vector3  angular\n"
    ),
    "geometry_msgs/TwistWithCovarianceStamped": (
        "# This represents an estimated twist with reference coordinate frame and timestamp.\n"
        "Header header\n"
        "TwistWithCovariance twist\n"
    ),
    "geometry_msgs/TwistWithCovariance": (
        "# This expresses velocity in free space with uncertainty.\n"
        "\n"
        "Twist twist\n"
        "\n"
        "# Row-major representation of the 6x6 covariance matrix\n"
        "# The orientation parameters use a fixed-axis representation.\n"
        "# In order, the parameters are:\n"
        "# (x, y, z, rotation about X axis, rotation about Y axis, rotation about Z axis)\n"
        "float64[36] covariance\n"
    ),
    "geometry_msgs/Vector3": (
        "# This represents a vector in free space. \n"
        "# It is only meant to represent a direction. Therefore, it does not\n"
        "# make sense to apply a translation to it (e.g., when applying a \n"
        "# generic rigid transformation to a Vector3, tf2 will only apply the\n"
        "# rotation). If you want your data to be translatable too, use the\n"
        "# geometry_msgs/Point message instead.\n"
        "\n"
        "float64 x\n"
        "float64 y\n"
        "float64 z"
    ),
    "geometry_msgs/Vector3Stamped": (
        "# This represents a Vector3 with reference coordinate frame and timestamp\n"
        "Header header\n"
        "Vector3 vector\n"
    ),
    "nav_msgs/Odometry": (
        "# This represents an estimate of a position and velocity in free space.  \n"
        "# The pose in this message should be specified in the coordinate frame given by header.frame_id.\n"
        "# The twist in this message should be specified in the coordinate frame given by the child_frame_id\n"
        "Header header\n"
        "string child_frame_id\n"
        "geometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist\n"
    ),
    "rosgraph_msgs/Clock": (
        "# roslib/Clock is used for publishing simulated time in ROS. \n"
        "# This message simply communicates the current time.\n"
        "# For more information, see http://www.ros.org/wiki/Clock\n"
        "time clock\n"
    ),
    "sensor_msgs/Imu": (
        "# This is a message to hold data from an IMU (Inertial Measurement Unit)\n"
        "#\n"
        "# Accelerations should be in m/s^2 (not in g's), and rotational velocity should be in rad/sec\n"
        "#\n"
        "# If the covariance of the measurement is known, it should be filled in (if all you know is the \n"
        "# variance of each measurement, e.g. from the datasheet, just put those along the diagonal)\n"
        '# A covariance matrix of all zeros will be interpreted as "covariance unknown", and to use the\n'
        "# data a covariance will have to be assumed or gotten from some other source\n"
        "#\n"
        "# If you have no estimate for one of the data elements (e.g. your IMU doesn't produce an orientation \n"
        "# estimate), please set element 0 of the associated covariance matrix to -1\n"
        "# If you are interpreting this message, please check for a value of -1 in the first element of each \n"
        "# covariance matrix, and disregard the associated estimate.\n"
        "\n"
        "Header header\n"
        "\n"
        "geometry_msgs/Quaternion orientation\n"
        "float64[9] orientation_covariance # Row major about x, y, z axes\n"
        "\n"
        "geometry_msgs/Vector3 angular_velocity\n"
        "float64[9] angular_velocity_covariance # Row major about x, y, z axes\n"
        "\n"
        "geometry_msgs/Vector3 linear_acceleration\n"
        "float64[9] linear_acceleration_covariance # Row major x, y z \n"
    ),
    "sensor_msgs/Temperature": (
        " # Single temperature reading.\n"
        "\n"
        " Header header           # timestamp is the time the temperature was measured\n"
        "                         # frame_id is the location of the temperature reading\n"
        "\n"
        " float64 temperature     # Measurement of the Temperature in Degrees Celsius\n"
        "\n"
        " float64 variance        # 0 is interpreted as variance unknown"
    ),
    "sensor_msgs/MagneticField": (
        " # Measurement of the Magnetic Field vector at a specific location.\n"
        "\n"
        " # If the covariance of the measurement is known, it should be filled in\n"
        " # (if all you know is the variance of each measurement, e.g. from the datasheet,\n"
        " #just put those along the diagonal)\n"
        ' # A covariance matrix of all zeros will be interpreted as "covariance unknown",\n'
        " # and to use the data a covariance will have to be assumed or gotten from some\n"
        " # other source\n"
        "\n"
        "\n"
        " Header header                        # timestamp is the time the\n"
        "                                      # field was measured\n"
        "                                      # frame_id is the location and orientation\n"
        "                                      # of the field measurement\n"
        "\n"
        " geometry_msgs/Vector3 magnetic_field # x, y, and z components of the\n"
        "                                      # field vector in Tesla\n"
        "                                      # If your sensor does not output 3 axes,\n"
        "                                      # put NaNs in the components not reported.\n"
        "\n"
        " float64[9] magnetic_field_covariance # Row major about x, y, z axes\n"
        "                                      # 0 is interpreted as variance unknown"
    ),
    "sensor_msgs/FluidPressure": (
        " # Single pressure reading.  This message is appropriate for measuring the\n"
        " # pressure inside of a fluid (air, water, etc).  This also includes\n"
        " # atmospheric or barometric pressure.\n"
        "\n"
        " # This message is not appropriate for force/pressure contact sensors.\n"
        "\n"
        " Header header           # timestamp of the measurement\n"
        "                         # frame_id is the location of the pressure sensor\n"
        "\n"
        " float64 fluid_pressure  # Absolute pressure reading in Pascals.\n"
        "\n"
        " float64 variance        # 0 is interpreted as variance unknown"
    ),
    "sensor_msgs/NavSatFix": (
        "# Navigation Satellite fix for any Global Navigation Satellite System\n"
        "#\n"
        "# Specified using the WGS 84 reference ellipsoid\n"
        "\n"
        "# header.stamp specifies the ROS time for this measurement (the\n"
        "#        corresponding satellite time may be reported using the\n"
        "#        sensor_msgs/TimeReference message).\n"
        "#\n"
        "# header.frame_id is the frame of reference reported by the satellite\n"
        "#        receiver, usually the location of the antenna.  This is a\n"
        "#        Euclidean frame relative to the vehicle, not a reference\n"
        "#        ellipsoid.\n"
        "Header header\n"
        "\n"
        "# satellite fix status information\n"
        "NavSatStatus status\n"
        "\n"
        "# Latitude [degrees]. Positive is north of equator; negative is south.\n"
        "float64 latitude\n"
        "\n"
        "# Longitude [degrees]. Positive is east of prime meridian; negative is west.\n"
        "float64 longitude\n"
        "\n"
        "# Altitude [m]. Positive is above the WGS 84 ellipsoid\n"
        "# (quiet NaN if no altitude is available).\n"
        "float64 altitude\n"
        "\n"
        "# Position covariance [m^2] defined relative to a tangential plane\n"
        "# through the reported position. The components are East, North, and\n"
        "# Up (ENU), in row-major order.\n"
        "#\n"
        "# Beware: this coordinate system exhibits singularities at the poles.\n"
        "\n"
        "float64[9] position_covariance\n"
        "\n"
        "# If the covariance of the fix is known, fill it in completely. If the\n"
        "# GPS receiver provides the variance of each measurement, put them\n"
        "# along the diagonal. If only Dilution of Precision is available,\n"
        "# estimate an approximate covariance from that.\n"
        "\n"
        "uint8 COVARIANCE_TYPE_UNKNOWN = 0\n"
        "uint8 COVARIANCE_TYPE_APPROXIMATED = 1\n"
        "uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN = 2\n"
        "uint8 COVARIANCE_TYPE_KNOWN = 3\n"
        "\n"
        "uint8 position_covariance_type\n"
    ),
    "sensor_msgs/NavSatStatus": (
        "# Navigation Satellite fix status for any Global Navigation Satellite System\n"
        "\n"
        "# Whether to output an augmented fix is determined by both the fix\n"
        "# type and the last time differential corrections were received.  A\n"
        "# fix is valid when status >= STATUS_FIX.\n"
        "\n"
        "int8 STATUS_NO_FIX =  -1        # unable to fix position\n"
        "int8 STATUS_FIX =      0        # unaugmented fix\n"
        "int8 STATUS_SBAS_FIX = 1        # with satellite-based augmentation\n"
        "int8 STATUS_GBAS_FIX = 2        # with ground-based augmentation\n"
        "\n"
        "int8 status\n"
        "\n"
        "# Bits defining which Global Navigation Satellite System signals were\n"
        "# used by the receiver.\n"
        "\n"
        "uint16 SERVICE_GPS =     1\n"
        "uint16 SERVICE_GLONASS = 2\n"
        "uint16 SERVICE_COMPASS = 4      # includes BeiDou.\n"
        "uint16 SERVICE_GALILEO = 8\n"
        "\n"
        "uint16 service\n"
    ),
    "std_msgs/Header": (
        "# Standard metadata for higher-level stamped data types.\n"
        "# This is generally used to communicate timestamped data \n"
        "# in a particular coordinate frame.\n"
        "# \n"
        "# sequence ID: consecutively increasing ID \n"
        "uint32 seq\n"
        "#Two-integer timestamp that is expressed as:\n"
        "# * stamp.sec: seconds (stamp_secs) since epoch (in Python the variable is called 'secs')\n"
        "# * stamp.nsec: nanoseconds since stamp_secs (in Python the variable is called 'nsecs')\n"
        "# time-handling sugar is provided by the client library\n"
        "time stamp\n"
        "#Frame this data is associated with\n"
        "string frame_id\n"
    ),
}

# Definitions that follow a type's own, in the order of ROS 1's gendeps.
NESTED: Final[dict[str, tuple[str, ...]]] = {
    "sensor_msgs/Imu": ("std_msgs/Header", "geometry_msgs/Quaternion", "geometry_msgs/Vector3"),
    "sensor_msgs/Temperature": ("std_msgs/Header",),
    "sensor_msgs/MagneticField": ("std_msgs/Header", "geometry_msgs/Vector3"),
    "sensor_msgs/FluidPressure": ("std_msgs/Header",),
    "sensor_msgs/NavSatFix": ("std_msgs/Header", "sensor_msgs/NavSatStatus"),
    "nav_msgs/Odometry": (
        "std_msgs/Header",
        "geometry_msgs/PoseWithCovariance",
        "geometry_msgs/Pose",
        "geometry_msgs/Point",
        "geometry_msgs/Quaternion",
        "geometry_msgs/TwistWithCovariance",
        "geometry_msgs/Twist",
        "geometry_msgs/Vector3",
    ),
    "geometry_msgs/PoseStamped": (
        "std_msgs/Header",
        "geometry_msgs/Pose",
        "geometry_msgs/Point",
        "geometry_msgs/Quaternion",
    ),
    "geometry_msgs/TwistWithCovarianceStamped": (
        "std_msgs/Header",
        "geometry_msgs/TwistWithCovariance",
        "geometry_msgs/Twist",
        "geometry_msgs/Vector3",
    ),
    "geometry_msgs/Vector3Stamped": ("std_msgs/Header", "geometry_msgs/Vector3"),
    "rosgraph_msgs/Clock": (),
}

MD5_SUMS: Final[dict[str, str]] = {
    **gps.MD5_SUMS,
    **livox.MD5_SUMS,
    "geometry_msgs/PoseStamped": "d3812c3cbc69362b77dc0b19b345f8f5",
    "geometry_msgs/TwistWithCovarianceStamped": "8927a1a12fb2607ceea095b2dc440a96",
    "geometry_msgs/Vector3Stamped": "7b324c7325e683bf02a9b14b01090ec7",
    "nav_msgs/Odometry": "cd5e73d190d741a2f92e81eda573aca7",
    "rosgraph_msgs/Clock": "a9c97c1d230cfc112e270351a944ee47",
    "sensor_msgs/CameraInfo": "c9a58c1b0b154e0e6da7578cb991d214",
    "sensor_msgs/CompressedImage": "8f7a12909da2c9d3332d540a0977563f",
    "sensor_msgs/FluidPressure": "804dc5cea1c5306d6a2eb80b9833befe",
    "sensor_msgs/Image": "060021388200f6f0f447d0fcd9c64743",
    "sensor_msgs/Imu": "6a62c6daae103f4ff57a132d6f95cec2",
    "sensor_msgs/JointState": "3066dcd76a6cfaef579bd0f34173e9fd",
    "sensor_msgs/MagneticField": "2f3b0b43eed0c9501de0fa3ff89a45aa",
    "sensor_msgs/NavSatFix": "2d3a8cd499b9b4a0249fb98fd05cfa48",
    "sensor_msgs/PointCloud": "d8e9c3f5afbdd8a130fd1d2763945fca",
    "sensor_msgs/PointCloud2": "1158d486dd51d683ce2f1be655c3c181",
    "sensor_msgs/Temperature": "ff71b307acdbe7c871a5a6d7ed359100",
}
"""MD5 sum of each type with all that it contains."""


def full_text(name: str) -> str | None:
    """Return the definition of a type and of all that it contains; None for an unknown type.

    :param name: in the form of ROS 1, for instance sensor_msgs/Imu.
    """
    from imu_sim_ros.bags.messages.definitions import ros1_cameras

    texts = {**TEXTS, **ros1_cameras.TEXTS, **gps.ROS1, **livox.ROS1}
    nested = {**NESTED, **ros1_cameras.NESTED, **gps.NESTED, **livox.NESTED}
    if name not in nested:
        return None
    others = "".join(f"{'=' * 80}\nMSG: {n}\n{texts[n]}\n" for n in nested[name])
    return f"{texts[name]}\n{others}"
