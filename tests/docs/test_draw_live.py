import draw_live
import numpy as np
import pytest
from draw_live import LARGEST, main

from thingmap.datasets.errors import UserError


def test_mistakes_are_one_line(tmp_path, capsys):
    recording = tmp_path / "run.rrd"
    assert main([str(recording), "-o", str(tmp_path / "a.jpg")]) == 2
    assert "thingmap run" in capsys.readouterr().err
    recording.write_bytes(b"not a recording")
    assert main([str(recording), "-o", str(tmp_path / "a.png")]) == 2
    assert "ending in .jpg" in capsys.readouterr().err
    pytest.importorskip("rerun")
    assert main([str(recording), "-o", str(tmp_path / "a.jpg")]) == 2
    assert capsys.readouterr().err.startswith(f"error: {recording}: expected a recording")
    assert not (tmp_path / "a.jpg").exists()


def test_pictures_fit_or_are_refused():
    random = np.random.default_rng(0)
    rough = random.integers(0, 255, (500, 500, 3), dtype=np.uint8)
    encoded = draw_live._as_jpeg(rough)
    assert 0.5 * LARGEST < len(encoded) <= LARGEST
    with pytest.raises(UserError, match="does not fit"):
        draw_live._as_jpeg(random.integers(0, 255, (2000, 2000, 3), dtype=np.uint8))


def test_a_browser_that_is_not_there_is_named():
    with pytest.raises(UserError, match="nosuchbrowser"):
        draw_live._browser("nosuchbrowser")
