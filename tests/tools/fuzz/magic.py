"""Values at which programs break: limits of types, what is no number, texts that look like something else."""

import struct

WHOLE = (
    *(
        0,
        1,
        -1,
        2,
        7,
        10,
        127,
        128,
        255,
        256,
        -128,
        32767,
        65535,
        65536,
        10**6,
        2**24,
        2**31 - 1,
        2**31,
        2**32,
        -(2**31),
    ),
    *(2**53 + 1, 2**62, 2**63 - 1, 2**63, 2**64 - 1, -(2**63)),
)
BEYOND_MSGPACK = (2**64, -(2**63) - 1, 10**30)
BROKEN = (
    *(0.0, -0.0, 0.5, -1.0, 1e-9, 5e-324, 1e-308, 1e9, 1e18, 1e19, 1e154, 1e300, 1.7976931348623157e308),
    *(float("nan"), float("inf"), float("-inf"), 2.0**31, 2.0**53, 2.0**63, -(2.0**63), 1 / 3),
)
TEXTS = (
    *(
        "",
        " ",
        "\n",
        "\x00",
        "a\x00b",
        "ä",
        "\u202e",
        "\U0001f41d",
        "\ufeff",
        "\x1b[31m",
        "%s%n",
        "{}",
        "../..",
        "/",
        ".",
    ),
    *("nan", "inf", "-1", "1e999", "0x10", "true", "null", "*", "**", "a/b", "a" * 70, "x" * 5000),
    *("file.py:Agent", "swarmwire.agent.behaviours:Flocking", "os:system", "robots.flock", "-0", "\ud7ff", "é" * 300),
)
BYTES = (
    *(b"", b"\x00", b"\xff", b"\xc1", b"\xc0", b"\x80", b"\x90", b"\xde\xff\xff", b"\xdd\xff\xff\xff\xff"),
    *(b"\xdf\xff\xff\xff\xff", b"\xc6\xff\xff\xff\xff", b"\xdb\x7f\xff\xff\xff", b"\x91" * 600, b"\x81\x01" * 600),
    *(b"\xef\xbb\xbf", b"\xed\xa0\x80", b"\xf4\x90\x80\x80", b"\r\n", b"[[", b"=", b'"""', b"[" * 600, b"{" * 600),
    *(struct.pack(order + kind, value) for order in "<>" for kind, value in (("d", 1e308), ("q", -(2**63)), ("i", -1))),
    *(struct.pack("<d", value) for value in (float("nan"), float("inf"), -0.0, 2.0**63)),
    *(struct.pack(order + "I", value) for order in "<>" for value in (0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 1)),
    *(struct.pack(order + "H", value) for order in "<>" for value in (0xFFFF, 0x7FFF, 0x8000)),
)
