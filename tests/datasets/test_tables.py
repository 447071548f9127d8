from pathlib import Path

import numpy as np
import pytest

from thingmap.datasets.errors import InputError
from thingmap.datasets.tables import read_table


def test_comments_blank_lines_tabs_and_a_byte_order_mark_are_understood(tmp_path: Path) -> None:
    (tmp_path / "t.txt").write_bytes(b"\xef\xbb\xbf# a comment\n\n1 2.5\n  -3e2\tnan\t\n#4 5\n")
    np.testing.assert_array_equal(read_table(tmp_path / "t.txt", "a b"), [[1, 2.5], [-300, np.nan]])


def test_a_file_of_comments_is_an_empty_table(tmp_path: Path) -> None:
    (tmp_path / "t.txt").write_text("# nothing\n")
    assert read_table(tmp_path / "t.txt", "a b c").shape == (0, 3)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"# head\n1 2\n3\n", ["rows of `a b`", "1 fields in line 3"]),
        (b"1 2\n\n3 four\n", ["'four' in line 3"]),
        (b"\xff\xfe\x00\x01", ["not text"]),
    ],
)
def test_a_wrong_file_names_the_line(tmp_path: Path, content: bytes, words: list[str]) -> None:
    path = tmp_path / "t.txt"
    path.write_bytes(content)
    with pytest.raises(InputError) as error:
        read_table(path, "a b")
    assert all(word in str(error.value) for word in [str(path), *words])


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file; look elsewhere"):
        read_table(tmp_path / "none.txt", "a b", "look elsewhere")
