// The divider of a picture that is shown beside another: moved by pointer and by arrows.

/** Calls `move` with the share left of the divider; `box` says where the picture lies in its place, in CSS pixels. */
function followDivider(divider, box, share, move) {
  const to = (value) => move(clamped(value, 0, 1));
  divider.addEventListener("pointerdown", (event) => divider.setPointerCapture(event.pointerId));
  divider.addEventListener("pointermove", (event) => {
    if (!divider.hasPointerCapture(event.pointerId)) return;
    const { left, width } = box();
    to((event.clientX - by("picture").getBoundingClientRect().left - left) / width);
  });
  divider.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -0.02, ArrowRight: 0.02 }[event.key];
    if (step) { event.preventDefault(); to(share() + step); }
  });
}
