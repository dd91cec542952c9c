"""`sdimu watch`: a test that runs elsewhere, seen in the terminal."""

from __future__ import annotations

from typing import Annotated

import typer

from sdimu_calibration.core.data_error import DataError


def watch(
    model: Annotated[str, typer.Option(help="Model that the node estimates: names the effects and their units.")] = (
        "baseline"
    ),
    domain: Annotated[int | None, typer.Option(min=0, max=232, help="ROS domain; ROS_DOMAIN_ID when left out.")] = None,
    seconds: Annotated[float, typer.Option("--for", min=0.0, help="Wall time to watch (s); 0 ends with Ctrl-C.")] = 0.0,
) -> None:
    """Watch a running test: stop, sigmas, light of the innovations, and the diagnosis at the end of each stop."""
    import os
    import time

    from sdimu_calibration.cli.console import console as make_console
    from sdimu_calibration.cli.watch import Outline, Watch
    from sdimu_calibration.core.effects import selection
    from sdimu_calibration.storage.files.effect_file import extended_model

    chosen = extended_model(model, ())
    effects = [selection.resolve(e) if isinstance(e, str) else e for e in chosen.effects]
    units = {q.name: q.display_unit for effect in effects for q in effect.parameters}
    if domain is not None:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
    # The domain is read when ROS is loaded.
    from sdimu_calibration.nodes.monitor import Monitor

    console, begun = make_console(), time.monotonic()
    used = os.environ.get("ROS_DOMAIN_ID", "0")
    end = f"ends after {seconds:g} s" if seconds else "Ctrl-C ends"
    console.print(f"watching ROS domain {used}; {end}", highlight=False)
    monitor = Monitor()
    try:
        with Watch(console, Outline(0.0, 0, [effect.key for effect in effects], units)) as shown:
            while not seconds or time.monotonic() - begun < seconds:
                shown.show(monitor.listen(0.2), True, time.monotonic() - begun)
    finally:
        monitor.close()
    if not monitor.progress.heard:
        raise DataError(f"ROS domain {used}: nothing heard in {seconds:g} s (is a test running? state its --domain)")
