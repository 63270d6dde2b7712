// The table of all fits: sorted by any column, of which only the rows in sight are there.

const ROW = 30, SPARE = 8;

class FitTable {
  /** `columns` are { title, hint, wide, left, value(fit), cell(fit) }. */
  constructor(place, columns) {
    Object.assign(this, { place, columns, rows: [], shown: new Map(), sorted: -1, falling: false, chosen: -1 });
    this.head = element("tr", { role: "row" }, ...columns.map((column, k) => this.heading(column, k)));
    this.body = element("tbody", { role: "rowgroup" });
    this.above = element("tr", { class: "space", role: "presentation" }, element("td", { colspan: columns.length }));
    this.below = this.above.cloneNode(true);
    const wide = columns.reduce((sum, column) => sum + column.wide, 0);
    this.table = element("table", { role: "grid", style: `width: ${wide}px; min-width: 100%` },
      element("colgroup", {}, ...columns.map((column) => element("col", { style: `width: ${column.wide}px` }))),
      element("thead", { role: "rowgroup" }, this.head), this.body);
    this.body.append(this.above, this.below);
    place.append(this.table);
    place.addEventListener("scroll", () => (this.pending ??= requestAnimationFrame(() => this.draw())));
    place.addEventListener("keydown", (event) => this.key(event));
    new ResizeObserver(() => this.draw()).observe(place);
  }

  heading(column, number) {
    const button = element("button", { type: "button", title: column.hint ?? null }, column.title);
    button.addEventListener("click", () => this.sort(number, this.sorted === number ? !this.falling : false));
    return element("th", { scope: "col", role: "columnheader", class: column.left ? "left" : null }, button);
  }

  show(fits) {
    this.fits = fits;
    this.order();
  }

  sort(number, falling) {
    [this.sorted, this.falling] = [number, falling];
    this.order();
  }

  /** The rows anew, from the top; fits without the figure come last either way. */
  order() {
    this.rows = [...this.fits];
    const column = this.columns[this.sorted];
    for (const [k, cell] of [...this.head.children].entries()) {
      if (k === this.sorted) cell.setAttribute("aria-sort", this.falling ? "descending" : "ascending");
      else cell.removeAttribute("aria-sort");
      cell.firstChild.textContent = this.columns[k].title + (k === this.sorted ? (this.falling ? " ↓" : " ↑") : "");
    }
    if (column) {
      const values = new Map(this.rows.map((fit) => [fit, column.value(fit)])), way = this.falling ? -1 : 1;
      const compared = typeof values.values().next().value === "string" ? NAMES.compare : (a, b) => a - b;
      this.rows.sort((one, other) => {
        const [a, b] = [values.get(one), values.get(other)];
        if (a === null || b === null) return (a === null) - (b === null) || one.number - other.number;
        return way * compared(a, b) || one.number - other.number;
      });
    }
    for (const row of this.shown.values()) row.remove();
    this.shown.clear();
    this.chosen = -1;
    this.place.removeAttribute("aria-activedescendant");
    this.table.setAttribute("aria-rowcount", this.rows.length + 1);
    this.place.scrollTop = 0;
    this.draw();
  }

  /** Rows in sight and a few round them; those that stay are left as they are. */
  draw() {
    this.pending = null;
    const first = Math.max(0, Math.floor(this.place.scrollTop / ROW) - SPARE);
    const last = Math.min(this.rows.length, first + Math.ceil((this.place.clientHeight || 600) / ROW) + 2 * SPARE);
    for (const [k, row] of this.shown) {
      if (k >= first && k < last) continue;
      row.remove();
      this.shown.delete(k);
    }
    let before = this.above;
    for (let k = first; k < last; k++) {
      let row = this.shown.get(k);
      if (!row) {
        row = this.row(this.rows[k], k);
        this.shown.set(k, row);
        before.after(row);
      }
      before = row;
    }
    this.above.style.height = `${first * ROW}px`;
    this.below.style.height = `${(this.rows.length - last) * ROW}px`;
  }

  row(fit, number) {
    const cells = this.columns.map((column) => element("td", { class: column.left ? "left" : null, role: "gridcell" }, column.cell(fit)));
    const row = element("tr", { role: "row", id: `row-${number}`, "aria-rowindex": number + 2, class: number === this.chosen ? "chosen" : null }, ...cells);
    row.addEventListener("click", (event) => { if (!event.target.closest("a")) this.choose(number); });
    return row;
  }

  choose(number) {
    this.shown.get(this.chosen)?.classList.remove("chosen");
    this.chosen = number;
    const head = this.head.offsetHeight, top = number * ROW;
    if (top < this.place.scrollTop) this.place.scrollTop = top;
    else if (top + ROW + head > this.place.scrollTop + this.place.clientHeight) this.place.scrollTop = top + ROW + head - this.place.clientHeight;
    this.draw();
    this.shown.get(number)?.classList.add("chosen");
    this.place.setAttribute("aria-activedescendant", `row-${number}`);
  }

  key(event) {
    if (event.target !== this.place || !this.rows.length || event.altKey || event.ctrlKey || event.metaKey) return;
    const last = this.rows.length - 1, page = Math.max(1, Math.floor(this.place.clientHeight / ROW) - 2);
    const step = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page }[event.key];
    if (step) this.choose(Math.min(last, Math.max(0, this.chosen + step)));
    else if (event.key === "Home") this.choose(0);
    else if (event.key === "End") this.choose(last);
    else if (event.key === "Enter" && this.chosen >= 0) location.href = addressOf(this.rows[this.chosen]);
    else return;
    event.preventDefault();
  }
}
