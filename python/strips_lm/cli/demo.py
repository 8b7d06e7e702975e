"""Open a local web page on which a model plans, step by step, under the oracle's eyes.

Pick a domain or load your own PDDL, edit objects, initial state and goal, choose how the model is decoded, and see its
plan with its states, the verdict, and what the oracle would do. Ends with Ctrl-C.
"""

from __future__ import annotations

import sys
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

from strips_lm.cli.arguments import add_config, natural, read_config

if TYPE_CHECKING:
    import argparse


def configure(parser: argparse.ArgumentParser) -> None:
    """Adds the command's arguments."""
    parser.add_argument("model", metavar="MODEL", help="a folder that `strips-lm train` wrote")
    where = "the address to listen at (default 127.0.0.1: this machine alone; anything else opens it to the network)"
    parser.add_argument("--host", default="127.0.0.1", metavar="ADDRESS", help=where)
    parser.add_argument("--port", type=natural, default=8642, metavar="N", help="the port; 0 takes a free one")
    parser.add_argument("--no-browser", action="store_true", help="print the address only")
    add_config(parser)


def run(args: argparse.Namespace) -> int:
    """Serves until interrupted."""
    config = read_config(args)
    from strips_lm.demo.server import make_server  # noqa: PLC0415
    from strips_lm.demo.service import Service  # noqa: PLC0415
    from strips_lm.demo.watch import WatchedPlanner  # noqa: PLC0415

    planner = WatchedPlanner.load(args.model, config.generate, config.seed)
    name = Path(args.model).resolve().name
    with make_server(Service(planner, name), args.host, args.port) as server:
        address = f"http://{args.host}:{server.server_address[1]}/"
        print(address, flush=True)
        sys.stderr.write("Ctrl-C ends it\n")
        if not args.no_browser:
            webbrowser.open(address)
        server.serve_forever()
    return 0
