"""``diagnostic_msgs``: health of a run."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from msg_adapters.builtin_interfaces import time_to_stamp
from sand_sim.border import Health


def health_to_diagnostics(
    health: Health, time: float, name: str, hardware_id: str, further: dict[str, str] | None = None, state: str = "running"
) -> DiagnosticArray:
    """Health of a run to an array with one status: OK, or WARN with the reasons not to trust it.

    Args:
        health: error indicators.
        time: of the observation [s].
        name: of the status.
        hardware_id: device the run is on.
        further: more values to show.
        state: what the run does now; also the message if nothing speaks against the run.
    """
    values = {
        "state": state,
        "time step [s]": f"{health.time_step:.6g}",
        "time step / safe step": f"{health.step_ratio:.3f}",
        "largest overlap / radius": f"{health.deepest:.4g}",
        "kinetic energy [J]": f"{health.kinetic:.6g}",
        "potential energy against start [J]": f"{health.potential:.6g}",
        "elastic energy [J]": f"{health.elastic:.6g}",
        "work of tools [J]": f"{health.tool_work:.6g}",
        "dissipated [J]": f"{health.dissipated:.6g}",
        "momentum residual [1]": f"{health.momentum_residual:.3g}",
        "fastest grain [m/s]": f"{health.fastest:.4g}",
        "contacts": str(health.contacts),
        "grains retired": str(health.retired),
    } | (further or {})
    status = DiagnosticStatus(
        level=DiagnosticStatus.WARN if health.doubts else DiagnosticStatus.OK,
        name=name,
        message="; ".join(health.doubts) or state,
        hardware_id=hardware_id,
        values=[KeyValue(key=key, value=value) for key, value in values.items()],
    )
    message = DiagnosticArray(status=[status])
    message.header.stamp = time_to_stamp(time)
    return message
