"""Tables and sections of the results file."""

from __future__ import annotations

from pathlib import Path

from results import machine, table, write_section


def test_table_lines_are_of_equal_length() -> None:
    lines = table(["a", "long head"], [["1", 2.5], ["wide cell", ""]]).split("\n")
    assert len(lines) == 4
    assert len({len(line) for line in lines}) == 1
    assert set(lines[1]) == {"|", "-"}


def test_a_section_replaces_only_itself(tmp_path: Path) -> None:
    path = tmp_path / "RESULTS.md"
    write_section("First", "one\n\n### detail\n\nmore", path)
    write_section("Second", "two", path)
    write_section("First", "uno\n", path)
    text = path.read_text()
    assert text.startswith("# Results\n")
    assert text.index("## First\n\nuno") < text.index("## Second\n\ntwo")
    assert "one" not in text.replace("## First", "")
    assert text.count("\n## ") == 2


def test_writing_the_same_again_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "RESULTS.md"
    write_section("First", "one", path)
    write_section("Second", "two", path)
    before = path.read_text()
    write_section("First", "one", path)
    write_section("Second", "two", path)
    assert path.read_text() == before


def test_the_machine_has_no_paths_or_names() -> None:
    line = machine()
    assert "cores" in line and "Python 3." in line
    assert "/" not in line
