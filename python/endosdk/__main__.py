"""``python -m endosdk`` is the command ``endosdk``."""

import sys

from endosdk.commands.cli import main

if __name__ == "__main__":  # not in the workers that a batch starts, which import this module again
    sys.exit(main())
