"""Labels of points in too little room: the optional ones go, the others stay, and none covers another."""

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Annotation

from homofact.figures.point_labels import PointLabel, label_points


@pytest.mark.parametrize("room", [1.3, 8.0])
def test_optional_labels_without_room_are_left_out(room: float) -> None:
    figure = Figure(figsize=(room, room))
    renderer = FigureCanvasAgg(figure).get_renderer()
    axes = figure.add_axes((0, 0, 1, 1))
    places = [(0.125 + 0.25 * (k % 4), 0.125 + 0.25 * (k // 4)) for k in range(16)]
    labels = [PointLabel(f"texture {k}", at, "black", k == 9, radius=3, optional=k != 9) for k, at in enumerate(places)]
    label_points(figure, axes, labels)
    names = [text for text in axes.texts if isinstance(text, Annotation) and text.get_text()]
    assert "texture 9" in [name.get_text() for name in names]
    assert (len(names) < len(labels)) == (room < 8)
    boxes = [name.get_window_extent(renderer) for name in names]
    for k, (name, box) in enumerate(zip(names, boxes, strict=True)):
        assert name.get_text() == "texture 9" or not any(box.overlaps(other) for other in boxes[k + 1 :])
        if name.get_text() != "texture 9":
            others = [axes.transData.transform(at) for at in places if at != tuple(map(float, name.xy))]
            assert not any(box.contains(*other) for other in others)
