"""A rule that was broken."""

from __future__ import annotations


class Violation(AssertionError):
    """What must never happen has happened.

    Args:
        rule: that is broken, in a few words; the same for all that break it.
        text: who broke it, and how.
    """

    def __init__(self, rule: str, text: str) -> None:
        super().__init__(f"{rule}: {text}")
        self.rule, self.text = rule, text
