"""`python -m clvol` is the command `clvol`."""

from clvol.cli.main import main

if __name__ == "__main__":
    main(prog_name="clvol")
