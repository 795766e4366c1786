"""Other processes and what Fast DDS keeps for them in shared memory, which outlives those that are killed."""

from pathlib import Path


def shared_memory(process):
    """The segments of a process, but for the ports that it has in common with others."""
    mapped = Path(f"/proc/{process.pid}/maps").read_text().split()
    return {Path(word) for word in mapped if word.startswith("/dev/shm/fastrtps_") and "port" not in word}


def kill(process):
    """Kill a process without warning, then tidy up after it."""
    left = shared_memory(process) if process.poll() is None else set()
    process.kill()
    process.communicate()
    for segment in left:
        segment.unlink(missing_ok=True)
        segment.with_name(f"{segment.name}_el").unlink(missing_ok=True)
