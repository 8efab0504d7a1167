"""`clvol devices`: what there is to render on."""

from __future__ import annotations

import click


@click.command()
def devices() -> None:
    """List the OpenCL devices; the first is used unless --device names another."""
    from clvol.base.memory import format_bytes
    from clvol.device.device import list_devices

    for device in list_devices():
        memory = format_bytes(device.global_memory)
        click.echo(f"{device.index}: {device.name}")
        click.echo(f"   {device.platform}, {device.version}")
        click.echo(f"   {device.kind}, {device.compute_units} compute units, {memory}")
