"""Campaign: inputs of atheris for peers with real minds: libFuzzer, guided by which lines of a peer run.

    make fuzz
    python -m tests.campaigns.guided_fuzz --inputs 1000000

Needs atheris, which nothing else does. It begins with an example of every message. A peer that fails on an input ends
the campaign, with the input in a file ``crash-...`` and a traceback.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import atheris

with atheris.instrument_imports(include=["agents", "protocol"]):
    from protocol.bus import Received
    from protocol.keys import ADDRESSED_KINDS, Address
    from protocol.messages import BODIES, decode
    from protocol.schemas import example_payloads
    from tests.campaigns.fuzz import LIFE, NAMES, Life, make_castings

KINDS = list(BODIES)


def main() -> None:
    """Give the inputs. libFuzzer ends the process."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    peers = [(casting, name) for casting in make_castings() for name in NAMES[:3]]
    lives = [Life(casting, name) for casting, name in peers]
    given = 0

    def give(data: bytes) -> None:
        nonlocal given
        peer = given % len(lives)
        given += 1
        if lives[peer].given >= LIFE:
            lives[peer] = Life(*peers[peer], given)
        kind = KINDS[data[0] % len(KINDS)] if data else KINDS[0]
        speaker = NAMES[data[1] % len(NAMES)] if len(data) > 1 else NAMES[0]
        to = peers[peer][1] if kind in ADDRESSED_KINDS else ""
        lives[peer].give(Received(Address("team", speaker, kind, operator=kind == "goal", to=to).key, data[2:]))
        if lives[peer].shell.traceback:
            raise AssertionError(f"{peers[peer][1]} failed:\n{lives[peer].shell.traceback}")

    with TemporaryDirectory() as corpus:
        for kind, payload in example_payloads().items():
            sender = decode(payload).sender
            first = bytes([KINDS.index(kind), NAMES.index(sender) if sender in NAMES else 0])
            (Path(corpus) / kind).write_bytes(first + payload)
        arguments = [f"-runs={options.inputs}", f"-seed={options.seed}", "-max_len=4096", "-print_final_stats=1"]
        atheris.Setup([sys.argv[0], *arguments, corpus], give)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
