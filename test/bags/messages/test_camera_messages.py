# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bytes of images, camera parameters and point clouds against rosbags' serialisation."""

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from imu_sim_ros.bags.messages.encode_cameras import (
    CAMERA_INFO,
    COMPRESSED_IMAGE,
    IMAGE,
    LIVOX,
    LIVOX_POINT,
    POINT_CLOUD,
    POINT_CLOUD2,
    CameraInfo,
    CameraInfoEncoder,
    CompressedImageEncoder,
    ImageEncoder,
    LivoxEncoder,
    PointCloud2Encoder,
    PointCloudEncoder,
)
from imu_sim_ros.bags.messages.schemas import schema, typestore

STORES = {"cdr": get_typestore(Stores.ROS2_JAZZY), "ros1": get_typestore(Stores.ROS1_NOETIC)}
T_NS = 1_700_000_000_123_456_789
RNG = np.random.default_rng(5)


def read(data, kind, encoding):
    """Return the message as rosbags reads it, having checked that rosbags writes the same bytes."""
    store = STORES[encoding]
    parse = store.deserialize_cdr if encoding == "cdr" else store.deserialize_ros1
    make = store.serialize_cdr if encoding == "cdr" else store.serialize_ros1
    message = parse(data, kind)
    assert bytes(make(message, kind)) == data
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == divmod(T_NS, 10**9)
    return message


@pytest.mark.parametrize("encoding", STORES)
@pytest.mark.parametrize("frame", ["cam0_optical_frame", "", "ä", "abc"])
@pytest.mark.parametrize(
    ("pixels", "shape", "kind"),
    [("mono8", (3, 5), "u1"), ("rgb8", (2, 3, 3), "u1"), ("32FC1", (3, 5), "<f4")],
)
def test_an_image_has_the_pixels_size_and_encoding_that_were_encoded(
    encoding, frame, pixels, shape, kind
):
    image = (RNG.random(shape) * 255).astype(kind)
    encoder = ImageEncoder(frame, shape[0], shape[1], pixels, encoding)
    message = read(encoder.encode(T_NS, image), IMAGE, encoding)
    assert (message.header.frame_id, message.encoding) == (frame, pixels)
    assert (message.height, message.width, message.step) == (*shape[:2], image.strides[0])
    assert not message.is_bigendian
    assert np.array_equal(message.data.view(kind).reshape(shape), image)


@pytest.mark.parametrize("encoding", STORES)
@pytest.mark.parametrize("pixels", ["mono8", "rgb8"])
def test_a_compressed_image_states_its_pixel_format(encoding, pixels):
    data = RNG.bytes(37)
    encoder = CompressedImageEncoder("cam0", pixels, encoding)
    message = read(encoder.encode(T_NS, data), COMPRESSED_IMAGE, encoding)
    assert message.data.tobytes() == data
    # image_transport's subscriber takes what stands before the semicolon for the encoding.
    assert message.format.split(";")[0] == pixels
    assert "png compressed" in message.format


@pytest.mark.parametrize("encoding", STORES)
@pytest.mark.parametrize("d", [(), (0.1, -0.2, 1e-3, 2e-4, 0.0)])
@pytest.mark.parametrize("frame", ["cam0", "camera"])
def test_camera_info_has_the_calibration_that_was_encoded(encoding, d, frame):
    k, r, p = RNG.random((3, 3)), np.eye(3), RNG.random((3, 4))
    info = CameraInfo(480, 752, "plumb_bob", d, k, r, p)
    encoder = CameraInfoEncoder(frame, info, encoding)
    message = read(encoder.encode(T_NS), CAMERA_INFO, encoding)
    fields = {name.lower(): getattr(message, name) for name in message.__dataclass_fields__}
    assert (fields["height"], fields["width"]) == (480, 752)
    assert fields["distortion_model"] == "plumb_bob"
    for name, values in (("d", d), ("k", k), ("r", r), ("p", p)):
        assert np.array_equal(fields[name], np.ravel(values))
    assert fields["roi"].height == 0
    assert not fields["roi"].do_rectify


@pytest.mark.parametrize("encoding", STORES)
@pytest.mark.parametrize("size", [0, 7])
def test_a_point_cloud_with_channels(encoding, size):
    points, values = RNG.random((size, 3)), RNG.random((size, 2))
    encoder = PointCloudEncoder("world", ("id", "camera_id"), encoding)
    cloud = read(encoder.encode(T_NS, points, values), POINT_CLOUD, encoding)
    assert [channel.name for channel in cloud.channels] == ["id", "camera_id"]
    for channel, column in zip(cloud.channels, values.T, strict=True):
        assert np.array_equal(channel.values, column.astype("f4"))
    expected = [tuple(row) for row in points.astype("f4").tolist()]
    assert [(p.x, p.y, p.z) for p in cloud.points] == expected


@pytest.mark.parametrize("encoding", STORES)
@pytest.mark.parametrize("size", [0, 7])
def test_a_cloud_of_landmarks(encoding, size):
    points, ids = RNG.random((size, 3)), np.arange(size) + 5
    rows = np.zeros(size, [*((axis, "<f4") for axis in "xyz"), ("id", "<u4")])
    rows["x"], rows["y"], rows["z"] = points.T
    rows["id"] = ids
    encoder = PointCloud2Encoder("world", encoding)
    cloud = read(encoder.encode(T_NS, rows), POINT_CLOUD2, encoding)
    assert (cloud.height, cloud.width, cloud.point_step, cloud.row_step) == (1, size, 16, 16 * size)
    fields = [(f.name, f.offset, f.datatype, f.count) for f in cloud.fields]
    assert fields == [("x", 0, 7, 1), ("y", 4, 7, 1), ("z", 8, 7, 1), ("id", 12, 6, 1)]
    assert cloud.is_dense
    rows = cloud.data.view([("xyz", "<f4", 3), ("id", "<u4")])
    assert np.array_equal(rows["xyz"], points.astype("f4"))
    assert np.array_equal(rows["id"], ids)


@pytest.mark.parametrize("encoding", STORES)
@pytest.mark.parametrize("size", [0, 1, 7])
def test_a_cloud_in_the_form_of_livox(encoding, size):
    rows = np.zeros(size, LIVOX_POINT)
    rows["offset_time"], rows["line"], rows["tag"] = np.arange(size) * 1000, 2, 16
    rows["x"], rows["y"], rows["z"] = RNG.random((3, size))
    store = typestore([(LIVOX, schema(LIVOX, encoding))], encoding)
    payload = LivoxEncoder("lidar", encoding).encode(T_NS, rows)
    decode = store.deserialize_cdr if encoding == "cdr" else store.deserialize_ros1
    cloud = decode(payload, LIVOX)
    assert (cloud.timebase, cloud.point_num, cloud.lidar_id) == (T_NS, size, 0)
    assert cloud.header.frame_id == "lidar"
    names = ("offset_time", "x", "y", "z", "reflectivity", "tag", "line")
    assert [tuple(getattr(p, n) for n in names) for p in cloud.points] == [
        tuple(row) for row in rows.tolist()
    ]
    write = store.serialize_cdr if encoding == "cdr" else store.serialize_ros1
    assert bytes(write(cloud, LIVOX)) == payload
