"""Keys are read as they are written, and what is none of ours is not mistaken for one."""

from __future__ import annotations

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from protocol import keys
from protocol.examples import EXAMPLES
from protocol.keys import Address
from protocol.messages import BODIES, PERIODIC_KINDS, Name, addressee_of, kind_of

names = st.builds(str.__add__, st.sampled_from("aoz"), st.text("az09_", max_size=31))
addresses = st.builds(
    Address, team=names, speaker=names, kind=st.sampled_from([*BODIES, keys.ALIVE]), operator=st.booleans()
) | st.builds(Address, team=names, speaker=names, kind=st.sampled_from(sorted(keys.ADDRESSED_KINDS)), to=names)


@given(addresses)
@settings(deadline=None)
def test_an_address_is_read_as_it_is_written(address: Address) -> None:
    assert keys.parse(address.key) == address
    assert address.key.startswith(keys.everything(address.team).removesuffix("**"))
    assert keys.route(address.key) == (address.kind, address.to)


chunks = st.sampled_from(["a", "v1", "operator", "alive", "vote", "goal", ""])


@given(st.text(max_size=40) | st.lists(chunks, max_size=7).map("/".join))
@settings(deadline=None)
def test_a_key_that_can_be_read_is_the_key_of_its_address_and_has_its_route(key: str) -> None:
    address, route = keys.parse(key), keys.route(key)
    assert address is None or (address.key, (address.kind, address.to)) == (key, route)


@pytest.mark.parametrize(
    "key",
    [
        "", "office", "office/v1/robot1", "office/v2/robot1/state", "office/v1/operator/state", "a/v1/b/c/d/e",
        "office/v1/robot1/state/base", "office/v1/robot1/vote/", "office/v1/operator/ada/vote/base",
    ],
)  # fmt: skip
def test_foreign_keys_have_no_address(key: str) -> None:
    assert keys.parse(key) is None


@given(st.text(max_size=5) | st.from_regex(r"[a-z][a-z0-9_]{0,33}\n?", fullmatch=True) | st.just("operator"))
@settings(deadline=None)
def test_messages_and_keys_agree_on_names(text: str) -> None:
    try:
        msgspec.convert(text, Name)
    except msgspec.ValidationError:
        assert not keys.is_name(text)
    else:
        assert keys.is_name(text)


def test_periodic_kinds_are_kinds() -> None:
    assert set(BODIES) >= PERIODIC_KINDS


def test_kinds_that_have_an_addressee_are_those_that_are_said_under_one() -> None:
    assert {kind_of(body) for body in EXAMPLES if addressee_of(body)} == keys.ADDRESSED_KINDS
