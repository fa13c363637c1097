"""The cache of maps: whatever happens to its files and folder, the arrays are those that were computed."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from planning import map_cache
from planning.map_cache import digest, fetch

ARRAYS = {
    "numbers": np.arange(12.0).reshape(3, 4),
    "words": np.array(["reflex", "vertex"]),
    "nothing": np.empty((0, 2), np.int32),
    "flag": np.array(True),
}


class Maker:
    """Computes `ARRAYS`, and counts how often."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self) -> dict[str, NDArray[Any]]:
        self.calls += 1
        return ARRAYS


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("SIGHTLINE_CACHE", str(tmp_path / "maps"))
    return tmp_path / "maps"


def check(found: dict[str, NDArray[Any]]) -> None:
    assert found.keys() == ARRAYS.keys()
    for name, array in found.items():
        assert array.dtype == ARRAYS[name].dtype
        np.testing.assert_array_equal(array, ARRAYS[name], strict=True)


def refuse() -> dict[str, NDArray[Any]]:
    raise AssertionError("computed again")


def silent(words: str) -> None:
    raise AssertionError(words)


def test_arrays_are_computed_once(folder: Path) -> None:
    check(fetch("sample", "key", Maker(), silent))
    check(fetch("sample", "key", refuse, silent))
    for part, key in (("sample", "other"), ("other", "key")):
        maker = Maker()
        fetch(part, key, maker, silent)
        assert maker.calls == 1
    assert len(list(folder.iterdir())) == 3
    with np.load(folder / "sample-key.npz") as archive:  # an npz file like any other
        np.testing.assert_array_equal(archive["numbers"], ARRAYS["numbers"])


def test_a_flipped_bit_anywhere_changes_nothing(folder: Path) -> None:
    fetch("sample", "key", Maker(), silent)
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    for place in range(0, len(whole), 7):
        damaged = bytearray(whole)
        damaged[place] ^= 1 << place % 8
        file.write_bytes(damaged)
        maker, said = Maker(), list[str]()
        check(fetch("sample", "key", maker, said.append))
        assert maker.calls == len(said) == 1
    check(fetch("sample", "key", refuse, silent))


def test_a_file_cut_short_is_computed_again(folder: Path) -> None:
    fetch("sample", "key", Maker(), silent)
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    for length in (0, 1, 22, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:length])
        maker, said = Maker(), list[str]()
        check(fetch("sample", "key", maker, said.append))
        assert maker.calls == 1
        assert len(said) == 1
        assert str(file) in said[0]
        check(fetch("sample", "key", refuse, silent))


def test_pickles_are_not_read(folder: Path) -> None:
    fetch("sample", "key", Maker(), silent)
    (file,) = folder.iterdir()
    version = np.load(file)["version"]
    archive = io.BytesIO()
    np.savez(archive, allow_pickle=True, version=version, numbers=np.array([{"a": 1}], dtype=object))
    content = archive.getvalue()[:-2] + b"\x08\x00"
    file.write_bytes(content + map_cache._seal(content))
    said: list[str] = []
    check(fetch("sample", "key", Maker(), said.append))
    assert "allow_pickle=False" in said[0]


def test_arrays_by_other_sources_are_replaced(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fetch("sample", "key", Maker(), silent)
    monkeypatch.setattr(map_cache, "_version", lambda: "another")
    maker = Maker()
    fetch("sample", "key", maker, silent)
    assert maker.calls == 1
    fetch("sample", "key", refuse, silent)
    assert len(list(folder.iterdir())) == 1


def test_the_version_changes_with_every_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = map_cache._version()
    for source in Path(map_cache.__file__).parent.glob("*.py"):
        (tmp_path / source.name).write_bytes(source.read_bytes())
    monkeypatch.setattr(map_cache, "__file__", str(tmp_path / "map_cache.py"))
    assert map_cache._version.__wrapped__() == before
    with (tmp_path / "arrangement.py").open("a") as source_file:
        source_file.write("\n")
    assert map_cache._version.__wrapped__() != before


def test_a_folder_that_cannot_be_made_is_said_and_done_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("SIGHTLINE_CACHE", str(tmp_path / "file" / "maps"))
    said: list[str] = []
    for _ in range(2):
        maker = Maker()
        check(fetch("sample", "key", maker, said.append))
        assert maker.calls == 1
    assert all("not kept" in words for words in said)


def test_a_full_disk_leaves_nothing_behind(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fill(*_: object, **__: object) -> None:
        raise OSError("No space left on device")

    monkeypatch.setattr(Path, "replace", fill)
    said: list[str] = []
    check(fetch("sample", "key", Maker(), said.append))
    assert said == ["what was computed from the map is not kept: No space left on device"]
    assert list(folder.iterdir()) == []


def test_what_computing_raises_is_raised(folder: Path) -> None:
    with pytest.raises(AssertionError, match="computed again"):
        fetch("sample", "key", refuse, silent)
    assert not folder.exists()


def test_where_the_folder_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SIGHTLINE_CACHE", "/somewhere")
    assert map_cache._folder() == Path("/somewhere")
    monkeypatch.setenv("SIGHTLINE_CACHE", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert map_cache._folder() == tmp_path / "sightline" / "maps"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    assert map_cache._folder() == tmp_path / ".cache" / "sightline" / "maps"
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert map_cache._folder() == tmp_path / ".cache" / "sightline" / "maps"


def test_without_a_home_nothing_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_home() -> Path:
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.delenv("SIGHTLINE_CACHE", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", no_home)
    for _ in range(2):
        maker = Maker()
        check(fetch("sample", "key", maker, silent))
        assert maker.calls == 1


def test_what_was_not_used_for_the_longest_time_is_dropped(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for age, key in enumerate("abcd"):
        fetch("sample", key, Maker(), silent)
        os.utime(folder / f"sample-{key}.npz", (1000.0 - age, 1000.0 - age))
    (folder / "tmpabcd.part").touch()
    os.utime(folder / "tmpabcd.part", (1.0, 1.0))
    fetch("sample", "d", refuse, silent)  # used just now
    size = (folder / "sample-a.npz").stat().st_size
    monkeypatch.setattr(map_cache, "MOST_BYTES", 3 * size)
    fetch("sample", "e", Maker(), silent)
    assert {file.name for file in folder.glob("*.npz")} == {"sample-a.npz", "sample-d.npz", "sample-e.npz"}
    monkeypatch.setattr(map_cache, "MOST_BYTES", 3 * size - 1)
    fetch("sample", "f", Maker(), silent)
    assert {file.name for file in folder.iterdir()} == {"sample-e.npz", "sample-f.npz"}


def test_many_writers_at_once(folder: Path) -> None:
    def compute() -> dict[str, NDArray[Any]]:
        return {"large": np.arange(50_000)}

    def work(turn: int) -> bool:
        if turn % 5 == 0:
            for file in folder.glob("*.npz"):
                file.unlink(missing_ok=True)
        return bool(np.array_equal(fetch("sample", f"{turn % 2}", compute, silent)["large"], np.arange(50_000)))

    with ThreadPoolExecutor(8) as threads:
        assert all(threads.map(work, range(200)))
    assert not list(folder.glob("*.part"))


@pytest.mark.parametrize(
    "change",
    [
        lambda a: a.T.copy(),
        lambda a: a.astype(np.float32),
        lambda a: a + np.spacing(a),
        lambda a: a.ravel(),
        lambda a: a.tolist(),
    ],
)
def test_digests_tell_arrays_apart(change: Callable[[NDArray[np.float64]], object]) -> None:
    array = np.arange(1.0, 7.0).reshape(2, 3)
    assert digest(array, "aspect", None) == digest(np.asfortranarray(array), "aspect", None)
    assert digest(array, "aspect", None) != digest(change(array), "aspect", None)
    assert digest(array, "aspect", None) != digest(array, "aspect", 1.0)
    assert digest("ab", "c") != digest("a", "bc")
