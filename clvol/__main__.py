"""The command `clvol`, which `python -m clvol` is too: quiet at Ctrl-C before and after its work."""

TYPE_CHECKING = False
if TYPE_CHECKING:
    import signal
    from typing import NoReturn
else:
    import _signal as signal  # what `signal` wraps: it is there already, and no import can be interrupted


def main() -> "NoReturn":
    """Run the command and exit.

    While modules are loaded Ctrl-C ends the process at once, where Python would print what it was importing.
    Once the work is done the exit status stands, and it is too late.

    Python remembers of an interrupt that it passed an `exec` of text, by which dataclasses are made, and then
    ends `python -m` by the signal, whatever its status; the next such text makes it forget.
    """
    heeds = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if heeds:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from clvol.cli.main import main as command

    if heeds:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        command(prog_name="clvol")
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        exec("")
    raise SystemExit


if __name__ == "__main__":
    main()
