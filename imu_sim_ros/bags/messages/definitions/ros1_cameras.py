# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# ruff: noqa: E501 - the lines of the definitions are as long as their authors made them
"""The text of the ROS 1 definitions of images, camera parameters, point clouds, joints and transforms.

To the letter, as those in ``ros1``: common_msgs 1.13.1 and geometry2 0.7.5, Copyright 2008-2010 Willow Garage,
Inc., BSD-3-Clause.
"""

from typing import Final

TEXTS: Final[dict[str, str]] = {
    "geometry_msgs/Transform": (
        "# This represents the transform between two coordinate frames in free space.\n"
        "\n"
        "Vector3 translation\n"
        "Quaternion rotation\n"
    ),
    "geometry_msgs/TransformStamped": (
        "# This expresses a transform from coordinate frame header.frame_id\n"
        "# to the coordinate frame child_frame_id\n"
        "#\n"
        "# This message is mostly used by the \n"
        '# <a href="http://wiki.ros.org/tf">tf</a> package. \n'
        "# See its documentation for more information.\n"
        "\n"
        "Header header\n"
        "string child_frame_id # the frame id of the child frame\n"
        "Transform transform\n"
    ),
    "sensor_msgs/JointState": (
        "# This is a message that holds data to describe the state of a set of torque controlled joints. \n"
        "#\n"
        "# The state of each joint (revolute or prismatic) is defined by:\n"
        "#  * the position of the joint (rad or m),\n"
        "#  * the velocity of the joint (rad/s or m/s) and \n"
        "#  * the effort that is applied in the joint (Nm or N).\n"
        "#\n"
        "# Each joint is uniquely identified by its name\n"
        "# The header specifies the time at which the joint states were recorded. All the joint states\n"
        "# in one message have to be recorded at the same time.\n"
        "#\n"
        "# This message consists of a multiple arrays, one for each part of the joint state. \n"
        "# The goal is to make each of the fields optional. When e.g. your joints have no\n"
        "# effort associated with them, you can leave the effort array empty. \n"
        "#\n"
        "# All arrays in this message should have the same size, or be empty.\n"
        "# This is the only way to uniquely associate the joint name with the correct\n"
        "# states.\n"
        "\n"
        "\n"
        "Header header\n"
        "\n"
        "string[] name\n"
        "float64[] position\n"
        "float64[] velocity\n"
        "float64[] effort\n"
    ),
    "tf2_msgs/TFMessage": ("geometry_msgs/TransformStamped[] transforms\n"),
    "geometry_msgs/Point32": (
        "# This contains the position of a point in free space(with 32 bits of precision).\n"
        "# It is recommeded to use Point wherever possible instead of Point32.  \n"
        "# \n"
        "# This recommendation is to promote interoperability.  \n"
        "#\n"
        "# This message is designed to take up less space when sending\n"
        "# lots of points at once, as in the case of a PointCloud.  \n"
        "\n"
        "float32 x\n"
        "float32 y\n"
        "float32 z"
    ),
    "sensor_msgs/CameraInfo": (
        "# This message defines meta information for a camera. It should be in a\n"
        '# camera namespace on topic "camera_info" and accompanied by up to five\n'
        "# image topics named:\n"
        "#\n"
        "#   image_raw - raw data from the camera driver, possibly Bayer encoded\n"
        "#   image            - monochrome, distorted\n"
        "#   image_color      - color, distorted\n"
        "#   image_rect       - monochrome, rectified\n"
        "#   image_rect_color - color, rectified\n"
        "#\n"
        "# The image_pipeline contains packages (image_proc, stereo_image_proc)\n"
        "# for producing the four processed image topics from image_raw and\n"
        "# camera_info. The meaning of the camera parameters are described in\n"
        "# detail at http://www.ros.org/wiki/image_pipeline/CameraInfo.\n"
        "#\n"
        "# The image_geometry package provides a user-friendly interface to\n"
        "# common operations using this meta information. If you want to, e.g.,\n"
        "# project a 3d point into image coordinates, we strongly recommend\n"
        "# using image_geometry.\n"
        "#\n"
        "# If the camera is uncalibrated, the matrices D, K, R, P should be left\n"
        "# zeroed out. In particular, clients may assume that K[0] == 0.0\n"
        "# indicates an uncalibrated camera.\n"
        "\n"
        "#######################################################################\n"
        "#                     Image acquisition info                          #\n"
        "#######################################################################\n"
        "\n"
        "# Time of image acquisition, camera coordinate frame ID\n"
        "Header header    # Header timestamp should be acquisition time of image\n"
        "                 # Header frame_id should be optical frame of camera\n"
        "                 # origin of frame should be optical center of camera\n"
        "                 # +x should point to the right in the image\n"
        "                 # +y should point down in the image\n"
        "                 # +z should point into the plane of the image\n"
        "\n"
        "\n"
        "#######################################################################\n"
        "#                      Calibration Parameters                         #\n"
        "#######################################################################\n"
        "# These are fixed during camera calibration. Their values will be the #\n"
        "# same in all messages until the camera is recalibrated. Note that    #\n"
        '# self-calibrating systems may "recalibrate" frequently.              #\n'
        "#                                                                     #\n"
        "# The internal parameters can be used to warp a raw (distorted) image #\n"
        "# to:                                                                 #\n"
        "#   1. An undistorted image (requires D and K)                        #\n"
        "#   2. A rectified image (requires D, K, R)                           #\n"
        "# The projection matrix P projects 3D points into the rectified image.#\n"
        "#######################################################################\n"
        "\n"
        "# The image dimensions with which the camera was calibrated. Normally\n"
        "# this will be the full camera resolution in pixels.\n"
        "uint32 height\n"
        "uint32 width\n"
        "\n"
        "# The distortion model used. Supported models are listed in\n"
        '# sensor_msgs/distortion_models.h. For most cameras, "plumb_bob" - a\n'
        "# simple model of radial and tangential distortion - is sufficient.\n"
        "string distortion_model\n"
        "\n"
        "# The distortion parameters, size depending on the distortion model.\n"
        '# For "plumb_bob", the 5 parameters are: (k1, k2, t1, t2, k3).\n'
        "float64[] D\n"
        "\n"
        "# Intrinsic camera matrix for the raw (distorted) images.\n"
        "#     [fx  0 cx]\n"
        "# K = [ 0 fy cy]\n"
        "#     [ 0  0  1]\n"
        "# Projects 3D points in the camera coordinate frame to 2D pixel\n"
        "# coordinates using the focal lengths (fx, fy) and principal point\n"
        "# (cx, cy).\n"
        "float64[9]  K # 3x3 row-major matrix\n"
        "\n"
        "# Rectification matrix (stereo cameras only)\n"
        "# A rotation matrix aligning the camera coordinate system to the ideal\n"
        "# stereo image plane so that epipolar lines in both stereo images are\n"
        "# parallel.\n"
        "float64[9]  R # 3x3 row-major matrix\n"
        "\n"
        "# Projection/camera matrix\n"
        "#     [fx'  0  cx' Tx]\n"
        "# P = [ 0  fy' cy' Ty]\n"
        "#     [ 0   0   1   0]\n"
        "# By convention, this matrix specifies the intrinsic (camera) matrix\n"
        "#  of the processed (rectified) image. That is, the left 3x3 portion\n"
        "#  is the normal camera intrinsic matrix for the rectified image.\n"
        "# It projects 3D points in the camera coordinate frame to 2D pixel\n"
        "#  coordinates using the focal lengths (fx', fy') and principal point\n"
        "#  (cx', cy') - these may differ from the values in K.\n"
        "# For monocular cameras, Tx = Ty = 0. Normally, monocular cameras will\n"
        "#  also have R = the identity and P[1:3,1:3] = K.\n"
        "# For a stereo pair, the fourth column [Tx Ty 0]' is related to the\n"
        "#  position of the optical center of the second camera in the first\n"
        "#  camera's frame. We assume Tz = 0 so both cameras are in the same\n"
        "#  stereo image plane. The first camera always has Tx = Ty = 0. For\n"
        "#  the right (second) camera of a horizontal stereo pair, Ty = 0 and\n"
        "#  Tx = -fx' * B, where B is the baseline between the cameras.\n"
        "# Given a 3D point [X Y Z]', the projection (x, y) of the point onto\n"
        "#  the rectified image is given by:\n"
        "#  [u v w]' = P * [X Y Z 1]'\n"
        "#         x = u / w\n"
        "#         y = v / w\n"
        "#  This holds for both images of a stereo pair.\n"
        "float64[12] P # 3x4 row-major matrix\n"
        "\n"
        "\n"
        "#######################################################################\n"
        "#                      Operational Parameters                         #\n"
        "#######################################################################\n"
        "# These define the image region actually captured by the camera       #\n"
        "# driver. Although they affect the geometry of the output image, they #\n"
        "# may be changed freely without recalibrating the camera.             #\n"
        "#######################################################################\n"
        "\n"
        "# Binning refers here to any camera setting which combines rectangular\n"
        '#  neighborhoods of pixels into larger "super-pixels." It reduces the\n'
        "#  resolution of the output image to\n"
        "#  (width / binning_x) x (height / binning_y).\n"
        "# The default values binning_x = binning_y = 0 is considered the same\n"
        "#  as binning_x = binning_y = 1 (no subsampling).\n"
        "uint32 binning_x\n"
        "uint32 binning_y\n"
        "\n"
        "# Region of interest (subwindow of full camera resolution), given in\n"
        "#  full resolution (unbinned) image coordinates. A particular ROI\n"
        "#  always denotes the same window of pixels on the camera sensor,\n"
        "#  regardless of binning settings.\n"
        "# The default setting of roi (all values 0) is considered the same as\n"
        "#  full resolution (roi.width = width, roi.height = height).\n"
        "RegionOfInterest roi\n"
    ),
    "sensor_msgs/ChannelFloat32": (
        "# This message is used by the PointCloud message to hold optional data\n"
        "# associated with each point in the cloud. The length of the values\n"
        "# array should be the same as the length of the points array in the\n"
        "# PointCloud, and each value should be associated with the corresponding\n"
        "# point.\n"
        "\n"
        "# Channel names in existing practice include:\n"
        '#   "u", "v" - row and column (respectively) in the left stereo image.\n'
        "#              This is opposite to usual conventions but remains for\n"
        "#              historical reasons. The newer PointCloud2 message has no\n"
        "#              such problem.\n"
        '#   "rgb" - For point clouds produced by color stereo cameras. uint8\n'
        "#           (R,G,B) values packed into the least significant 24 bits,\n"
        "#           in order.\n"
        '#   "intensity" - laser or pixel intensity.\n'
        '#   "distance"\n'
        "\n"
        "# The channel name should give semantics of the channel (e.g.\n"
        '# "intensity" instead of "value").\n'
        "string name\n"
        "\n"
        "# The values array should be 1-1 with the elements of the associated\n"
        "# PointCloud.\n"
        "float32[] values\n"
    ),
    "sensor_msgs/CompressedImage": (
        "# This message contains a compressed image\n"
        "\n"
        "Header header        # Header timestamp should be acquisition time of image\n"
        "                     # Header frame_id should be optical frame of camera\n"
        "                     # origin of frame should be optical center of camera\n"
        "                     # +x should point to the right in the image\n"
        "                     # +y should point down in the image\n"
        "                     # +z should point into to plane of the image\n"
        "\n"
        "string format        # Specifies the format of the data\n"
        "                     #   Acceptable values:\n"
        "                     #     jpeg, png\n"
        "uint8[] data         # Compressed image buffer\n"
    ),
    "sensor_msgs/Image": (
        "# This message contains an uncompressed image\n"
        "# (0, 0) is at top-left corner of image\n"
        "#\n"
        "\n"
        "Header header        # Header timestamp should be acquisition time of image\n"
        "                     # Header frame_id should be optical frame of camera\n"
        "                     # origin of frame should be optical center of camera\n"
        "                     # +x should point to the right in the image\n"
        "                     # +y should point down in the image\n"
        "                     # +z should point into to plane of the image\n"
        "                     # If the frame_id here and the frame_id of the CameraInfo\n"
        "                     # message associated with the image conflict\n"
        "                     # the behavior is undefined\n"
        "\n"
        "uint32 height         # image height, that is, number of rows\n"
        "uint32 width          # image width, that is, number of columns\n"
        "\n"
        "# The legal values for encoding are in file src/image_encodings.cpp\n"
        "# If you want to standardize a new string format, join\n"
        "# ros-users@lists.sourceforge.net and send an email proposing a new encoding.\n"
        "\n"
        "string encoding       # Encoding of pixels -- channel meaning, ordering, size\n"
        "                      # taken from the list of strings in include/sensor_msgs/image_encodings.h\n"
        "\n"
        "uint8 is_bigendian    # is this data bigendian?\n"
        "uint32 step           # Full row length in bytes\n"
        "uint8[] data          # actual matrix data, size is (step * rows)\n"
    ),
    "sensor_msgs/PointCloud": (
        "# This message holds a collection of 3d points, plus optional additional\n"
        "# information about each point.\n"
        "\n"
        "# Time of sensor data acquisition, coordinate frame ID.\n"
        "Header header\n"
        "\n"
        "# Array of 3d points. Each Point32 should be interpreted as a 3d point\n"
        "# in the frame given in the header.\n"
        "geometry_msgs/Point32[] points\n"
        "\n"
        "# Each channel should have the same number of elements as points array,\n"
        "# and the data in each channel should correspond 1:1 with each point.\n"
        "# Channel names in common practice are listed in ChannelFloat32.msg.\n"
        "ChannelFloat32[] channels\n"
    ),
    "sensor_msgs/PointCloud2": (
        "# This message holds a collection of N-dimensional points, which may\n"
        "# contain additional information such as normals, intensity, etc. The\n"
        "# point data is stored as a binary blob, its layout described by the\n"
        '# contents of the "fields" array.\n'
        "\n"
        "# The point cloud data may be organized 2d (image-like) or 1d\n"
        "# (unordered). Point clouds organized as 2d images may be produced by\n"
        "# camera depth sensors such as stereo or time-of-flight.\n"
        "\n"
        "# Time of sensor data acquisition, and the coordinate frame ID (for 3d\n"
        "# points).\n"
        "Header header\n"
        "\n"
        "# 2D structure of the point cloud. If the cloud is unordered, height is\n"
        "# 1 and width is the length of the point cloud.\n"
        "uint32 height\n"
        "uint32 width\n"
        "\n"
        "# Describes the channels and their layout in the binary data blob.\n"
        "PointField[] fields\n"
        "\n"
        "bool    is_bigendian # Is this data bigendian?\n"
        "uint32  point_step   # Length of a point in bytes\n"
        "uint32  row_step     # Length of a row in bytes\n"
        "uint8[] data         # Actual point data, size is (row_step*height)\n"
        "\n"
        "bool is_dense        # True if there are no invalid points\n"
    ),
    "sensor_msgs/PointField": (
        "# This message holds the description of one point entry in the\n"
        "# PointCloud2 message format.\n"
        "uint8 INT8    = 1\n"
        "uint8 UINT8   = 2\n"
        "uint8 INT16   = 3\n"
        "uint8 UINT16  = 4\n"
        "uint8 INT32   = 5\n"
        "uint8 UINT32  = 6\n"
        "uint8 FLOAT32 = 7\n"
        "uint8 FLOAT64 = 8\n"
        "\n"
        "string name      # Name of field\n"
        "uint32 offset    # Offset from start of point struct\n"
        "uint8  datatype  # Datatype enumeration, see above\n"
        "uint32 count     # How many elements in the field\n"
    ),
    "sensor_msgs/RegionOfInterest": (
        "# This message is used to specify a region of interest within an image.\n"
        "#\n"
        "# When used to specify the ROI setting of the camera when the image was\n"
        "# taken, the height and width fields should either match the height and\n"
        "# width fields for the associated image; or height = width = 0\n"
        "# indicates that the full resolution image was captured.\n"
        "\n"
        "uint32 x_offset  # Leftmost pixel of the ROI\n"
        "                 # (0 if the ROI includes the left edge of the image)\n"
        "uint32 y_offset  # Topmost pixel of the ROI\n"
        "                 # (0 if the ROI includes the top edge of the image)\n"
        "uint32 height    # Height of ROI\n"
        "uint32 width     # Width of ROI\n"
        "\n"
        '# True if a distinct rectified ROI should be calculated from the "raw"\n'
        "# ROI in this message. Typically this should be False if the full image\n"
        "# is captured (ROI not used), and True if a subwindow is captured (ROI\n"
        "# used).\n"
        "bool do_rectify\n"
    ),
}

NESTED: Final[dict[str, tuple[str, ...]]] = {
    "sensor_msgs/Image": ("std_msgs/Header",),
    "sensor_msgs/CompressedImage": ("std_msgs/Header",),
    "sensor_msgs/CameraInfo": (
        "std_msgs/Header",
        "sensor_msgs/RegionOfInterest",
    ),
    "sensor_msgs/PointCloud": (
        "std_msgs/Header",
        "geometry_msgs/Point32",
        "sensor_msgs/ChannelFloat32",
    ),
    "sensor_msgs/PointCloud2": (
        "std_msgs/Header",
        "sensor_msgs/PointField",
    ),
    "sensor_msgs/JointState": ("std_msgs/Header",),
    "tf2_msgs/TFMessage": (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header",
        "geometry_msgs/Transform",
        "geometry_msgs/Vector3",
        "geometry_msgs/Quaternion",
    ),
}
