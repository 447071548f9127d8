// The panel of the chosen thing: what it is, where, how large, and on what evidence.

class Panel {
  // `on` has close(), focus(), point(row or null) and go(row).
  constructor(element, map, crops, on) {
    Object.assign(this, { element, map, crops, on });
    this.urls = [];
  }

  show(thing) {
    for (const url of this.urls.splice(0)) URL.revokeObjectURL(url);
    this.element.hidden = !thing;
    if (!thing) return this.element.replaceChildren();
    const parts = [this.head(thing), ...this.classes(thing), ...this.place(thing), ...this.evidence(thing)];
    this.element.replaceChildren(...parts, ...this.pictures(thing), ...this.edits(thing));
    this.element.scrollTop = 0;
  }

  head(thing) {
    const button = (text, label, click) => make("button", { className: "icon", text, title: label, "aria-label": label, on: { click } });
    const named = thing.name ? `${thing.label} · ${thing.id}` : thing.id;
    return make("header", {
      children: [
        swatch(colorOf(this.map, thing.label)),
        make("h2", { text: thing.name || thing.label }),
        button("◎", "Go there (F)", () => this.on.focus()),
        button("✕", "Close (Esc)", () => this.on.close()),
        make("p", { className: "quiet", text: `${named} · probability ${percent(thing.belief)}` }),
      ],
    });
  }

  classes(thing) {
    const row = (name, p, color) => [make("span", { className: "cut", text: name, title: name }), barOf(p, color), make("span", { className: "number", text: percent(p) })];
    const bars = thing.posterior.flatMap(([label, p]) => row(label, p, css(colorOf(this.map, label))));
    return [
      make("h3", { text: "Whether it exists, and its class if so" }),
      make("div", { className: "bars", children: row("exists", thing.existence, "var(--accent)") }),
      make("div", { className: "bars", id: "posterior", children: bars }),
    ];
  }

  place(thing) {
    const cm = (value) => (100 * value).toFixed(1);
    const cells = (values, stds, digits) => values.map((value, k) =>
      make("td", { text: digits(value), children: [make("span", { className: "std", text: ` ± ${cm(stds[k])}` })] }));
    const line = (name, ...rest) => make("tr", { children: [make("th", { text: name, scope: "row" }), ...rest] });
    const head = (...names) => make("thead", { children: [make("tr", { children: ["", ...names].map((text) => make("th", { text, scope: "col" })) })] });
    const positions = make("table", { className: "numbers", children: [head("x", "y", "z"), line("cm", ...cells(thing.position, thing.position_std, cm))] });
    const sizes = [line("cm", ...cells(thing.size, thing.size_std, cm))];
    if (thing.volume_size) sizes.push(line("boxes alone", ...cells(thing.volume_size, thing.volume_size_std, cm)));
    const turned = `turned ${((180 * thing.yaw) / Math.PI).toFixed(0)}° about up`;
    const points = thing.points === undefined ? "" : ` · ${thing.points.toLocaleString("en")} labelled points`;
    return [
      make("h3", { text: "Position" }), positions,
      make("h3", { text: "Size" }),
      make("table", { className: "numbers", children: [head("width", "depth", "height"), ...sizes] }),
      make("p", { className: "quiet", text: turned + points }),
    ];
  }

  evidence(thing) {
    const [supporting, occluded, contradicting] = thing.evidence;
    const seen = `found from ${thing.first_seen.toFixed(2)} s to ${thing.last_seen.toFixed(2)} s`;
    const parts = [make("h3", { text: "Evidence over time" })];
    const views = thing.views;
    if (!views || !views.rows.length) {
      const why = views ? "No view is kept on record." : "Nothing is on record of its views.";
      return [...parts, make("p", { className: "quiet", text: `${supporting} views supported it, in ${occluded} it was hidden, ${contradicting} contradicted it; ${seen}. ${why}` })];
    }
    const key = [["for", "supported"], ["silent", "hidden or unclear"], ["against", "contradicted"]].map(([side, text]) =>
      make("span", { className: side, children: [make("i"), text] }));
    const more = views.left_out ? ` ${views.left_out} that said nothing are not drawn.` : "";
    const asked = views.label === thing.label ? "" : ` Ratios are those of a ${views.label}.`;
    return [
      ...parts,
      ...timelineOf(this.map, thing, this.on),
      make("div", { className: "key", children: key }),
      make("p", { className: "quiet", text: `${views.summary}; ${seen}.${more}${asked}` }),
    ];
  }

  pictures(thing) {
    const title = make("h3", { text: "What the camera saw" });
    if (!thing.crops.length) {
      const none = thing.views ? "Its strongest views show nothing of it inside their image." : "No view of it is on record.";
      return [title, make("p", { className: "quiet", id: "no-crops", text: this.map.crops_note || none })];
    }
    const box = make("div", { className: "crops" });
    for (const [against, name] of [[false, "strongest for it"], [true, "strongest against it"]]) {
      const own = thing.crops.filter((crop) => crop.against === against);
      if (own.length) box.append(make("h4", { text: name }), ...own.map((crop) => this.picture(thing, crop)));
    }
    return [title, box];
  }

  picture(thing, crop) {
    const row = thing.views.rows.find((view) => view[0] === crop.stamp);
    const url = URL.createObjectURL(new Blob([this.crops.subarray(crop.at, crop.at + crop.bytes)], { type: "image/jpeg" }));
    this.urls.push(url);
    const text = row ? row[7] : "";
    const image = make("img", { src: url, alt: text, width: crop.width, height: crop.height });
    const ratio = row ? ` · ${row[3] >= 0 ? "+" : "−"}${Math.abs(row[3]).toFixed(1)}` : "";
    return make("button", {
      className: `crop ${crop.against ? "against" : "for"}`,
      title: `${row ? row[6] + ": " : ""}${text}`,
      children: [image, make("span", { text: `${crop.stamp.toFixed(1)} s${ratio}` })],
      on: { click: () => row && this.on.go(row), pointerenter: () => this.on.point(row || null), pointerleave: () => this.on.point(null) },
    });
  }

  edits(thing) {
    if (!thing.edits) return [];
    const items = thing.edits.map((text) => make("li", { text }));
    return [make("h3", { text: "Changed by hand" }), make("ul", { className: "edits", children: items })];
  }
}
