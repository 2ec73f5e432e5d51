# Copyright 2026 imu_sim_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""DataFlash logs of ArduPilot, binary and text, by the description of the format.

Each message has two bytes of head and its number; FMT messages define length, format and fields.
"""

import struct

import numpy as np

HEAD = b"\xa3\x95"
CODES = {
    "a": "64s", "b": "b", "B": "B", "h": "h", "H": "H", "i": "i", "I": "I", "f": "f", "d": "d",
    "n": "4s", "N": "16s", "Z": "64s", "c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "Q": "Q",
}  # fmt: skip
SCALES = {"c": 100, "C": 100, "e": 100, "E": 100, "L": 1e7}
FORMATS = {
    "FMT": ("BBnNZ", "Type,Length,Name,Format,Columns"),
    "IMU": ("QBffffffIIfBBHH", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"),
    "IMU2": ("QffffffIIfBBHH", "TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz"),
    "GYR": ("QBQfff", "TimeUS,I,SampleUS,GyrX,GyrY,GyrZ"),
    "ACC": ("QBQfff", "TimeUS,I,SampleUS,AccX,AccY,AccZ"),
    "ISBH": ("QHBBHHQf", "TimeUS,N,type,instance,mul,smp_cnt,SampleUS,smp_rate"),
    "ISBD": ("QHHaaa", "TimeUS,N,seqno,x,y,z"),
    "XKF1": ("QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH"),
    "XKQ": ("QBffff", "TimeUS,C,Q1,Q2,Q3,Q4"),
    "ATT": ("QccccCCCC", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw"),
    "AHR2": ("QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4"),
    "POS": ("QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "SIM": ("QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4"),
    "SIM2": ("Qfffffffff", "TimeUS,PN,PE,PD,VN,VE,VD,As,ASpdU,X"),
    "GPS": ("QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U"),
    "GPA": ("QBCCCCfBIHf", "TimeUS,I,VDop,HAcc,VAcc,SAcc,YAcc,VV,SMS,Delta,Und"),
    "MAG": ("QBhhhhhhhhhBI", "TimeUS,I,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,MOX,MOY,MOZ,Health,S"),
    "BARO": ("QBffcfIffB", "TimeUS,I,Alt,Press,Temp,CRt,SMS,Offset,GndTemp,Health"),
    "VIBE": ("QBfffI", "TimeUS,IMU,VibeX,VibeY,VibeZ,Clip"),
    "CPU": ("QI", "TimeUS,Load"),
}
NUMBERS = {name: 0x80 + k for k, name in enumerate(FORMATS)}


def size(name):
    """Return the length of a message of this name in bytes, head included."""
    return 3 + struct.calcsize("<" + "".join(CODES[letter] for letter in FORMATS[name][0]))


def rows_of(tables):
    """Return (time, name, values by field) of all messages, in the order of time.

    :param tables: ``{"IMU": {"TimeUS": (n,), "GyrX": (n,), ...}, ...}``; fields left out are 0.
        A name may have a suffix, ``IMU/1``.
    """
    rows = []
    for key, columns in tables.items():
        name = key.partition("/")[0]
        for k, t in enumerate(np.asarray(columns["TimeUS"]).tolist()):
            rows.append((t, name, {field: values[k] for field, values in columns.items()}))
    return sorted(rows, key=lambda row: row[0])


def packed(name, values):
    """Return the bytes of a message; ``values`` are by field, those left out are 0."""
    letters, fields = FORMATS[name]
    cells = []
    for letter, field in zip(letters, fields.split(","), strict=True):
        value = values.get(field, 0)
        if letter == "a":
            value = np.zeros(32, "<i2").tobytes() if field not in values else value.tobytes()
        elif letter in "nNZ":
            value = value.encode()
        elif letter in SCALES:
            value = round(float(value) * SCALES[letter])
        elif letter in "fd":
            value = float(value)
        else:
            value = int(value)
        cells.append(value)
    body = struct.pack("<" + "".join(CODES[letter] for letter in letters), *cells)
    return HEAD + bytes([NUMBERS[name]]) + body


def definition(name):
    """Return the fields of the FMT message that defines the messages of this name."""
    letters, fields = FORMATS[name]
    return {
        "Type": NUMBERS[name], "Length": size(name), "Name": name, "Format": letters,
        "Columns": fields,
    }  # fmt: skip


def write(path, tables):
    """Write a binary log of tables as for :func:`rows_of`, and return its path."""
    names = dict.fromkeys(["FMT", *(key.partition("/")[0] for key in tables)])
    parts = [packed("FMT", definition(name)) for name in names]
    parts += [packed(name, values) for _, name, values in rows_of(tables)]
    path.write_bytes(b"".join(parts))
    return path


def write_text(path, tables):
    """Write a text log of tables as for :func:`rows_of`, and return its path."""
    names = dict.fromkeys(["FMT", *(key.partition("/")[0] for key in tables)])
    lines = []
    for name in names:
        lines.append("FMT, " + ", ".join(map(str, definition(name).values())).replace(",T", ",T"))
    for _, name, values in rows_of(tables):
        letters, fields = FORMATS[name]
        cells = [
            text(letter, values.get(field, 0))
            for letter, field in zip(letters, fields.split(","), strict=True)
        ]
        lines.append(", ".join([name, *cells]))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def text(letter, value):
    """Return a value as text, by the letter of its format."""
    if letter == "a":
        return "[" + ", ".join(map(str, np.asarray(value).tolist())) + "]"
    return repr(float(value)) if letter in "fdcCeEL" else str(int(value))
