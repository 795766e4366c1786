"""Warp's start without words."""

import os

import warp as wp


def start_warp() -> None:
    """Start Warp without its greeting, and without the line that its library writes to stderr where no GPU has a driver.

    Raises:
        OSError: if there is no place for compiled kernels; the message says how to mend it.
    """
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    stderr, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        wp.init()
    except OSError as error:  # users in containers often have no home
        raise OSError(f"compiled kernels cannot be kept: {error}; set WARP_CACHE_PATH to a folder that can be written") from None
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(nowhere)
