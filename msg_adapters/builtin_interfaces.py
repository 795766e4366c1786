"""``builtin_interfaces``: simulated seconds and stamps."""

from builtin_interfaces.msg import Time


def time_to_stamp(seconds: float) -> Time:
    """Seconds since time zero, at least 0 [s], to a stamp, to the nearest nanosecond."""
    nanoseconds = round(seconds * 1e9)
    return Time(sec=nanoseconds // 1_000_000_000, nanosec=nanoseconds % 1_000_000_000)


def stamp_to_time(stamp: Time) -> float:
    """A stamp to seconds [s]."""
    return stamp.sec + stamp.nanosec * 1e-9
