"""The Rerun viewer, opened on this machine only."""

import socket
import subprocess
import sys
import time

_PORT = 9876
_PATIENCE = 15.0  # [s] for the viewer to listen
_PROBATION = 2.0  # [s] in which a viewer without a screen gives up


def open_viewer() -> str | None:
    """Open a viewer and wait until it can be sent to; it stays open when we end.

    Returns:
        The address to send to, or None if no viewer could be opened, for example because there is no screen.
    """
    # Rerun's own spawn helper listens on all interfaces.
    command = [sys.executable, "-m", "rerun", "--bind", "127.0.0.1", "--port", str(_PORT)]
    viewer = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end and viewer.poll() is None:
        try:
            socket.create_connection(("127.0.0.1", _PORT), timeout=0.2).close()
        except OSError:
            time.sleep(0.1)
            continue
        time.sleep(_PROBATION)
        break
    return f"rerun+http://127.0.0.1:{_PORT}/proxy" if viewer.poll() is None else None
