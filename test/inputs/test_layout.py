# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Text tables as people have them: their headers, separators, units and stamps."""

import numpy as np
import pytest

from imu_sim_ros.bags.read import read_imu
from imu_sim_ros.core.errors import InputError, Remark
from imu_sim_ros.inputs.poses import read_poses

T0 = 1_700_000_000_000_000_000
N = 40
RNG = np.random.default_rng(3)
T_NS = T0 + 5_000_000 * np.arange(N)
GYRO = RNG.normal(size=(N, 3))
ACCEL = RNG.normal(size=(N, 3)) + np.array([0.0, 0.0, 9.8])
POSITION = RNG.normal(size=(N, 3))
Q_WB = RNG.normal(size=(N, 4))
Q_WB /= np.linalg.norm(Q_WB, axis=1, keepdims=True)


def write(path, header, stamps, *columns, separator=",", end=""):
    rows = [
        separator.join([str(stamp), *(f"{x:.12g}" for x in np.concatenate(row))]) + end
        for stamp, *row in zip(stamps, *columns, strict=True)
    ]
    path.write_text("\n".join([header, *rows] if header else rows) + "\n")
    return path


@pytest.mark.parametrize(
    ("header", "columns", "stamps"),
    [
        ("timestamp,ax,ay,az,gx,gy,gz", (ACCEL, GYRO), T_NS),
        ("timestamp,omega_z,omega_y,omega_x,alpha_z,alpha_y,alpha_x",
         (GYRO[:, ::-1], ACCEL[:, ::-1]), T_NS),
        ("timestamp [ns],gyro_x [deg/s],gyro_y [deg/s],gyro_z [deg/s],accel_x [g],accel_y [g],"
         "accel_z [g]", (np.degrees(GYRO), ACCEL / 9.80665), T_NS),
        ("t_us,gyro_x_dps,gyro_y_dps,gyro_z_dps,acc_x_mg,acc_y_mg,acc_z_mg",
         (np.degrees(GYRO), ACCEL / 9.80665e-3), T_NS // 1000),
        ("timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],gyro_integral_dt,accelerometer_m_s2[0],"
         "accelerometer_m_s2[1],accelerometer_m_s2[2]", (GYRO, GYRO[:, :1], ACCEL), T_NS // 1000),
        ("# timestamp (s),AccX,AccY,AccZ,GyrX,GyrY,GyrZ", (ACCEL, GYRO), T_NS // 10**6 / 1e3),
        ("%time,field.header.stamp,field.angular_velocity.x,field.angular_velocity.y,"
         "field.angular_velocity.z,field.linear_acceleration.x,field.linear_acceleration.y,"
         "field.linear_acceleration.z", (T_NS[:, None] * 1.0, GYRO, ACCEL), T_NS),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
def test_the_header_decides_columns_axes_and_units(tmp_path, header, columns, stamps):
    readings = read_imu(write(tmp_path / "imu.csv", header, stamps, *columns))
    # Stamps as %.12g are rounded to 1 ms at most; floats of 1.7e18 to 10 s.
    assert np.abs(np.diff(readings.t_ns - T_NS)).max() < 1e10
    np.testing.assert_allclose(readings.gyro, GYRO, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(readings.accel, ACCEL, rtol=1e-9, atol=1e-10)


def table(header, stamps, *columns, separator=",", quote="", comma=False, newline="\n"):
    """Return the text of a table; numbers in quotes, or with decimal commas."""
    rows = [[str(stamp), *(f"{x:.12g}" for x in np.concatenate(row))]
            for stamp, *row in zip(stamps, *columns, strict=True)]  # fmt: skip
    if comma:
        rows = [[cell.replace(".", ",") for cell in row] for row in rows]
    lines = [separator.join(f"{quote}{cell}{quote}" for cell in row) for row in rows]
    return newline.join([*header, *lines, ""])


NAMES = "timestamp,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z"


@pytest.mark.parametrize(
    "text",
    [
        table([NAMES], T_NS, GYRO, ACCEL, newline="\r"),
        table(["sep=;", NAMES.replace(",", ";")], T_NS, GYRO, ACCEL, separator=";"),
        table(["// of my IMU", "% 200 Hz", NAMES], T_NS, GYRO, ACCEL),
        table([NAMES], T_NS, GYRO, ACCEL, quote='"', comma=True),
        table([NAMES.replace(",", "\t")], T_NS, GYRO, ACCEL, separator="\t", comma=True),
        table([NAMES.replace(",", "\t")], T_NS, GYRO, ACCEL, separator="\t", quote='"'),
        table([NAMES, "us;;;;mg;mg;mg".replace(";", ",").replace(",,,,", ",deg/s,deg/s,deg/s,")],
              T_NS // 1000, np.degrees(GYRO), ACCEL / 9.80665e-3),
        table(["Zeit [ns];Drehrate X [°/s];Drehrate Y [°/s];Drehrate Z [°/s];Beschleunigung X [g];"
               "Beschleunigung Y [g];Beschleunigung Z [g]"],
              T_NS, np.degrees(GYRO), ACCEL / 9.80665, separator=";", comma=True),
        table(["时间(ns),加速度X(g),加速度Y(g),加速度Z(g),角速度X(°/s),角速度Y(°/s),角速度Z(°/s)"],
              T_NS, ACCEL / 9.80665, np.degrees(GYRO)),
        table(["time [ns],Roll rate,Pitch rate,Yaw rate,Ax,Ay,Az"], T_NS, GYRO, ACCEL),
        table(["time [ns],p,q,r,ax,ay,az"], T_NS, GYRO, ACCEL),
        table(["time [ns],rollspeed,pitchspeed,yawspeed,ax,ay,az"], T_NS, GYRO, ACCEL),
        table(["#timestamp [ns],ax,ay,az,gx,gy,gz,temp"], T_NS, ACCEL, GYRO),
        table(["#timestamp [ns],ax,ay,az,gx,gy,gz"], T_NS, ACCEL, GYRO, GYRO[:, :1]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1"])
@pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
def test_tables_of_other_programs_and_languages(tmp_path, text, encoding):
    path = tmp_path / "imu.tsv"
    path.write_bytes(text.encode(encoding if "时" not in text else "utf-8"))
    readings = read_imu(path)
    assert (np.diff(readings.t_ns) == 5_000_000).all()
    np.testing.assert_allclose(readings.gyro, GYRO, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(readings.accel, ACCEL, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (table([NAMES.replace("stamp", "stamp [ns]")], T_NS / 1e9, GYRO, ACCEL),
         "the header says ns, and the stamps increase by 0.005:"),
        (table([NAMES.replace("stamp", "stamp [us]")], T_NS // 10**6, GYRO, ACCEL),
         "the header says us, and the stamps increase by 5:"),
        (table([NAMES], [f"2024-05-01 10:00:00.{5 * k:03d}" for k in range(N)], GYRO, ACCEL),
         "the stamps are dates: '2024-05-01 10:00:00.000'; write them as seconds"),
    ],
)  # fmt: skip
def test_stamps_that_contradict_the_header_are_refused(tmp_path, text, reason):
    path = tmp_path / "imu.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=reason):
        read_imu(path)


def test_a_table_in_utf_16_is_named(tmp_path):
    path = tmp_path / "imu.csv"
    path.write_text(table([NAMES], T_NS, GYRO, ACCEL), encoding="utf-16")
    with pytest.raises(InputError, match="text in UTF-16; save it in UTF-8"):
        read_imu(path)


def test_columns_of_unknown_names_are_told_if_a_triad_is_missing(tmp_path):
    path = write(tmp_path / "imu.csv", "timestamp,u,b,c,ax,ay,az", T_NS, GYRO, ACCEL)
    with pytest.warns(Remark, match="no gyroscope; the columns u, b, c have names that are not"):
        assert read_imu(path).gyro is None


@pytest.mark.parametrize("step", [1, 50])
def test_whole_stamps_of_poses_are_told(tmp_path, step):
    stamps = step * np.arange(N)
    path = write(tmp_path / "p.txt", "", stamps, POSITION, Q_WB[:, [1, 2, 3, 0]], separator=" ")
    with pytest.warns(Remark, match=f"increase by {step} and have no decimals: taken as s"):
        read_poses(path)


def test_the_order_of_a_quaternion_without_a_header_is_told(tmp_path):
    path = write(tmp_path / "p.csv", "", T_NS / 1e9, POSITION, Q_WB)
    with pytest.warns(Remark, match="no header: the quaternion as w, x, y, z"):
        read_poses(path)


def test_poses_with_decimal_commas_and_a_header(tmp_path):
    path = tmp_path / "p.csv"
    seconds, q_xyzw = (T_NS - T0) / 1e9, Q_WB[:, [1, 2, 3, 0]]
    header = ["t;x;y;z;qx;qy;qz;qw"]
    path.write_text(table(header, seconds, POSITION, q_xyzw, separator=";", comma=True))
    with pytest.warns(Remark, match="taken as s"):
        np.testing.assert_allclose(read_poses(path).position, POSITION, rtol=1e-9, atol=1e-11)


def test_units_of_a_header_are_told(tmp_path):
    header = "timestamp,gx [deg/s],gy [deg/s],gz [deg/s],ax,ay,az"
    path = write(tmp_path / "imu.csv", header, T_NS, GYRO, ACCEL)
    with pytest.warns(Remark, match="gyroscope in deg/s, as the header says"):
        read_imu(path)


@pytest.mark.parametrize(
    ("header", "reason"),
    [
        ("timestamp,ax,ay,az,gx,gy", "has no gyroscope z"),
        ("timestamp,ax,ax,az,gx,gy,gz", "ax and ax are both accelerometer x"),
        ("timestamp,ax [g],ay [m/s^2],az [g],gx,gy,gz", "different units: g and m/s"),
        ("timestamp,ax,ay,az,gx [lsb],gy [lsb],gz [lsb]", "the unit lsb is not one of rad/s"),
        ("b,c,d,e,f,h,i", "has no stamp; known are timestamp"),
        ("timestamp,ax,ay,az,gx,gy,gz,mx", "the header names 8 columns, line 2 has 7"),
    ],
)
def test_unknown_and_contradictory_headers_are_refused(tmp_path, header, reason):
    path = write(tmp_path / "imu.csv", header, T_NS, GYRO, ACCEL)
    with pytest.raises(InputError, match=reason):
        read_imu(path)


@pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
def test_a_table_of_one_triad_has_no_other(tmp_path):
    header = "time,seconds_elapsed,z,y,x"
    columns = (np.arange(N)[:, None] * 5e-3, GYRO[:, ::-1])
    readings = read_imu(write(tmp_path / "Gyroscope.csv", header, T_NS, *columns))
    assert readings.accel is None
    np.testing.assert_allclose(readings.gyro, GYRO)
    with pytest.raises(InputError, match="whose x, y, z"):
        read_imu(write(tmp_path / "log.csv", header, T_NS, *columns))


@pytest.mark.parametrize(
    ("header", "reason"),
    [
        ("timestamp,x [m],y [m],z [m]", "x .m.: the unit m is not one of m/s.2, g, mg"),
        ("timestamp,x,y", "has no accelerometer z"),
        ("timestamp,accel_x [g],accel_y [g],accel_z [g],x,y,z", "are both accelerometer x"),
    ],
)
def test_axes_named_by_the_file_are_checked_as_named_columns(tmp_path, header, reason):
    columns = (ACCEL, GYRO)[: 1 + (header.count(",") > 3)]
    path = write(tmp_path / "accelerometer.csv", header, T_NS, *columns)
    with pytest.raises(InputError, match=reason):
        read_imu(path)


@pytest.mark.parametrize("start_ns", [-5_000_000, T0])
def test_a_first_row_of_numbers_is_no_header(tmp_path, start_ns):
    stamps = start_ns + 5_000_000 * np.arange(N)
    readings = read_imu(write(tmp_path / "imu.csv", "", stamps, GYRO, ACCEL))
    assert readings.t_ns.tolist() == stamps.tolist()


def xyzw(q):
    return q[:, [1, 2, 3, 0]]


@pytest.mark.parametrize(
    ("form", "header", "stamps", "orientation"),
    [
        ((",", ""), "#timestamp,p_x,p_y,p_z,q_x,q_y,q_z,q_w", T_NS, xyzw(Q_WB)),
        ((",", ""), "#timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z", T_NS, Q_WB),
        ((", ", ""), "timestamp, p_WS_W_x, p_WS_W_y, p_WS_W_z, q_WS_x, q_WS_y, q_WS_z, q_WS_w",
         T_NS, xyzw(Q_WB)),
        (("\t", ""), "TimeStamp\tPOS_X\tPOS_Y\tPOS_Z\tQ_W\tQ_X\tQ_Y\tQ_Z", T_NS // 10**6, Q_WB),
        ((" ", ""), "", [f"{float(t):.6f}" for t in T_NS], xyzw(Q_WB)),
        ((",", ","), "", T_NS, Q_WB),
        ((";", ""), "timestamp [ms];x;y;z;qx;qy;qz;qw", T_NS // 10**6, xyzw(Q_WB)),
        ((",", ""), "", T_NS // 10**6, Q_WB),
        ((" ", ""), "# timestamp tx ty tz qx qy qz qw", T_NS // 10**6 / 1e3, xyzw(Q_WB)),
    ],
    ids=["xyzw", "wxyz", "okvis2", "airsim", "orb_slam3", "vins", "spreadsheet", "ms", "tum"],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
@pytest.mark.parametrize("mark", [b"", b"\xef\xbb\xbf"])
def test_poses_as_estimators_write_them(tmp_path, form, header, stamps, orientation, mark):
    separator, end = form
    path = tmp_path / "poses.csv"
    write(path, header, stamps, POSITION, orientation, separator=separator, end=end)
    if separator == ";":
        path.write_text(path.read_text().replace(".", ","))
    path.write_bytes(mark + path.read_bytes())
    poses = read_poses(path)
    assert np.abs(poses.t_ns - T_NS).max() <= 256  # float64 of 1.7e18
    np.testing.assert_allclose(poses.position, POSITION, rtol=1e-9)
    np.testing.assert_allclose(poses.q_wb, Q_WB, atol=1e-9)


def test_numbers_of_rows_are_no_stamps(tmp_path):
    path = write(tmp_path / "poses.csv", "", range(N), POSITION, Q_WB)
    with pytest.raises(InputError, match="stamps increase by 1: they may be milliseconds"):
        read_poses(path)


@pytest.mark.parametrize(
    ("row", "reason"),
    [
        ("1.5,1,2,3,4,5,6", "'1.5' is not a stamp in whole nanoseconds"),
        ("1e18,1,2,3,4,5,6", "'1e18' is not a stamp in whole nanoseconds"),
        ("9223372035000000001,1,2,3,4,5,6", "'9223372035000000001' is not a stamp"),
        ("-9223372036854775808,1,2,3,4,5,6", "'-9223372036854775808' is not a stamp"),
        (f"{T0},1,2,3,4,5,6,7", "8 columns"),
        ('""', "1 columns"),
    ],
)
def test_a_bad_row_among_whole_nanoseconds_is_named(tmp_path, row, reason):
    header = "timestamp,gx,gy,gz,ax,ay,az"
    path = write(tmp_path / "imu.csv", header, T_NS, GYRO, ACCEL)
    with path.open("a") as file:
        file.write(row + "\n")
    with pytest.raises(InputError, match=f"line {N + 2}: .*{reason}"):
        read_imu(path)


@pytest.mark.parametrize(
    ("seconds", "part"),
    [("sec", "nsec"), ("field.header.stamp.secs", "field.header.stamp.nsecs"),
     ("header.stamp.sec", "header.stamp.nanosec"), ("stamp [s]", "stamp [ns]")],
)  # fmt: skip
@pytest.mark.parametrize("swapped", [False, True])
def test_seconds_and_nanoseconds_are_one_stamp(tmp_path, seconds, part, swapped):
    whole, remainder_ns = np.divmod(T_NS + 300_000_000 * np.arange(N) + 7, 10**9)
    names, stamps = [seconds, part], np.stack([whole, remainder_ns])
    if swapped:
        names, stamps = names[::-1], stamps[::-1]
    header = ",".join([*names, *(f"gyro_{a}" for a in "xyz"), *(f"accel_{a}" for a in "xyz")])
    texts = [f"{a},{b}" for a, b in stamps.T.tolist()]
    readings = read_imu(write(tmp_path / "imu.csv", header, texts, GYRO, ACCEL))
    assert readings.t_ns.tolist() == (whole * 10**9 + remainder_ns).tolist()
    np.testing.assert_allclose(readings.accel, ACCEL, rtol=1e-11)
    text = (tmp_path / "imu.csv").read_text().replace(f",{remainder_ns[7]},", ",1000000000,", 1)
    text = text if not swapped else text.replace(f"\n{remainder_ns[7]},", "\n1000000000,", 1)
    (tmp_path / "imu.csv").write_text(text)
    with pytest.raises(
        InputError, match="line 9: '1000000000' is not nanoseconds from 0 to 9999999"
    ):
        read_imu(tmp_path / "imu.csv")


def test_a_time_in_seconds_and_in_nanoseconds_is_read_once(tmp_path):
    header = "timestamp_s,timestamp_ns,gx,gy,gz,ax,ay,az"
    texts = [f"{t / 1e9:.6f},{t}" for t in T_NS.tolist()]
    readings = read_imu(write(tmp_path / "imu.csv", header, texts, GYRO, ACCEL))
    assert readings.t_ns.tolist() == T_NS.tolist()


def test_states_of_openvins_are_read_by_their_header(tmp_path):
    header = ("# timestamp(s) q p v bg ba cam_imu_dt num_cam cam0_k cam0_d cam0_rot cam0_trans\n"
              "# another line of text")  # fmt: skip
    zero = np.zeros((N, 11))
    stamps = [f"{t // 10**9}.{t % 10**9:09d}" for t in T_NS.tolist()]
    columns = (Q_WB[:, [1, 2, 3, 0]], POSITION, GYRO, zero)
    poses = read_poses(write(tmp_path / "state.txt", header, stamps, *columns, separator=" "))
    assert poses.t_ns.tolist() == T_NS.tolist()
    np.testing.assert_allclose(poses.position, POSITION, rtol=1e-11)
    # OpenVINS' JPL quaternion from the world to the IMU is Hamilton's from the IMU to the world.
    np.testing.assert_allclose(poses.q_wb, Q_WB, rtol=1e-11)


def test_rows_that_share_a_stamp_have_a_text_too():
    from imu_sim_ros.core.timebase import describe_span

    assert describe_span(np.array([0, 0, 0, 5_000_000])) == "4 in 0.005 s"


DEGREES = np.linspace(-20.0, 60.0, N)


@pytest.mark.parametrize(
    ("name", "scale", "zero"),
    [
        ("temperature", 1.0, 0.0),
        ("temp", 1.0, 0.0),
        ("T", 1.0, 0.0),
        ("tempC", 1.0, 0.0),
        ("imu_temp", 1.0, 0.0),
        ("temperature [degC]", 1.0, 0.0),
        ("Temp (°C)", 1.0, 0.0),
        ("T [K]", 1.0, 273.15),
        ("temperature_kelvin", 1.0, 273.15),
        ("temp_f", 1.8, 32.0),
        ("temperature [mdegC]", 1e3, 0.0),
        ("temp_millidegrees", 1e3, 0.0),
    ],
)
@pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
def test_a_column_of_temperatures_is_read_in_its_unit(tmp_path, name, scale, zero):
    header = f"timestamp,{name},ax,ay,az,gx,gy,gz"
    columns = ((scale * DEGREES + zero)[:, None], ACCEL, GYRO)
    readings = read_imu(write(tmp_path / "imu.csv", header, T_NS, *columns))
    np.testing.assert_allclose(readings.temperature, DEGREES, atol=1e-9)
    np.testing.assert_allclose(readings.gyro, GYRO)


def test_cells_without_a_temperature_leave_the_readings_as_they_are(tmp_path):
    path = write(tmp_path / "imu.csv", "timestamp,gx,gy,gz,ax,ay,az,temp", T_NS, GYRO, ACCEL)
    head, *rows = path.read_text().splitlines()
    cells = ["21.5" if k % 4 == 0 else "nan" if k % 4 == 1 else "" for k in range(N)]
    lines = [f"{row},{cell}" for row, cell in zip(rows, cells, strict=True)]
    path.write_text("\n".join([head, *lines]) + "\n")
    readings = read_imu(path)
    assert len(readings) == N
    assert np.isfinite(readings.temperature).tolist() == [k % 4 == 0 for k in range(N)]
    path.write_text(path.read_text().replace("21.5", "warm", 1))
    with pytest.raises(InputError, match="line 2: 'warm' is not a number"):
        read_imu(path)


@pytest.mark.parametrize(
    ("names", "line"),
    [
        ("temp [raw]", "temp \\[raw\\] is not read: the unit raw is not one of degC, K"),
        ("gyro_temp,imu_temp", "the temperature is that of imu_temp; gyro_temp is not read"),
    ],
)
def test_temperatures_that_are_not_read_are_told(tmp_path, names, line):
    degrees = np.repeat(DEGREES[:, None], names.count(",") + 1, axis=1)
    header = f"timestamp,gx,gy,gz,ax,ay,az,{names}"
    path = write(tmp_path / "imu.csv", header, T_NS, GYRO, ACCEL, degrees)
    with pytest.warns(Remark, match=line):
        readings = read_imu(path)
    assert (readings.temperature is None) == ("raw" in names)


@pytest.mark.filterwarnings("ignore::imu_sim_ros.core.errors.Remark")
@pytest.mark.parametrize("name", ["gyro_x_temp_comp", "temp_t_ns", "chamber_temp"])
def test_other_columns_are_no_temperatures(tmp_path, name):
    names = ["timestamp", "gx", "gy", "gz", "ax", "ay", "az", name]
    columns = (GYRO, ACCEL, DEGREES[:, None])
    if name.startswith("gyro_x"):
        names[1], columns = names.pop(), columns[:2]
    readings = read_imu(write(tmp_path / "imu.csv", ",".join(names), T_NS, *columns))
    assert readings.temperature is None
