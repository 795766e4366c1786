"""What people read while a run goes on and when it is over."""

from sand_sim.sinks.run_log import RunLog


def progress_line(log: RunLog) -> str:
    """One line on where a run is."""
    row = log.rows[-1]
    parts = [
        f"t {_seconds(row['time']):>6} s",
        f"wall {_seconds(row['wall'], 1):>6} s",
        f"real-time factor {log.real_time_factor:.3f}",
        f"{row['contacts']:,} contacts",
    ]
    for tool in log.scene.tools:
        x, y, z = row[f"{tool.name}.force"]
        parts.append(f"{tool.name} ({x:.1f}, {y:.1f}, {z:.1f}) N, {row[f'{tool.name}.carried']:.2f} kg")
    return "  ".join(parts)


def _seconds(time: float, places: int = 2) -> str:
    """With so many decimal places, and three digits of less than a tenth: an impact lasts microseconds."""
    return f"{time:.{places}f}" if time >= 0.1 else f"{time:.3g}"


def summary_text(summary: dict) -> str:
    """The summary of a run as a table, SI units."""
    if not summary.get("steps"):
        return "nothing was simulated"
    energy = summary["energy_J"]
    start = sum(energy[name] for name in ("kinetic", "potential", "elastic", "dissipated")) - energy["tool_work"]
    rows = [
        ("grains", f"{summary['grains']:,} ({summary['retired_grains']} left the domain)"),
        ("steps", f"{summary['steps']:,} of {summary['time_step_s'] * 1e6:.3g} us"),
        (
            "simulated",
            f"{_seconds(summary['simulated_s'])} s in {_seconds(summary['wall_s'], 1)} s"
            f", real-time factor {summary['real_time_factor']:.3f}",
        ),
        ("contacts", f"{summary['contacts']:,}"),
        ("largest overlap / radius", f"{summary['largest_overlap_over_radius']:.4f}"),
        ("momentum residual", f"{summary['largest_momentum_residual']:.1e} of all forces"),
        (
            "energy balance",
            f"at the start {start:.3g} + work of tools {energy['tool_work']:.4g} J = kinetic {energy['kinetic']:.3g}"
            f" + potential {energy['potential']:.3g} + elastic {energy['elastic']:.3g} + the rest, dissipated"
            f" {energy['dissipated']:.4g}",
        ),
        ("energy from nowhere", f"{energy['gained']:.2g} J, by which that rest has fallen"),
    ]
    if summary["interrupted"]:
        rows.insert(3, ("interrupted", "by the user, before its end"))
    for name, tool in summary["tools"].items():
        if not tool["peak_force_N"]:
            rows.append((name, "has met no grain; `sand_sim plan` tells where its mesh lies in its frame"))
            continue
        rows.append((f"{name}: peak draft", f"{tool['peak_draft_N']:.1f} N"))
        rows.append((f"{name}: peak lift", f"{tool['peak_lift_N']:.1f} N"))
        for name_of, opposite in (("pull", "draft"), ("bearing", "lift")):  # what matters of wheels and plates
            if tool[f"peak_{name_of}_N"] > tool[f"peak_{opposite}_N"]:
                rows.append((f"{name}: peak {name_of}", f"{tool[f'peak_{name_of}_N']:.1f} N"))
        rows.append((f"{name}: peak torque", f"{tool['peak_torque_Nm']:.3g} N m"))
        if "carried_kg" in tool:
            weight = tool["carried_weight_N"]
            rows.append((f"{name}: carried", f"{tool['carried_kg']:.3f} kg (the tool feels {weight:.2f} N)"))
            rows.append((f"{name}: spilled on the way", f"{tool['spilled_kg']:.3f} kg"))
    for doubt in summary["doubts"]:
        rows.append(("not to be trusted", doubt))
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"  {name:<{width}}  {value}" for name, value in rows)
