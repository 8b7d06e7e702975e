"""`python -m strips_lm`: the same as the `strips-lm` command."""

from strips_lm.cli import entry

if __name__ == "__main__":
    entry()
