// Copies and downloads of a report's tables, figures and answers; without JavaScript the page lacks nothing else.
(() => {
  const isSimulated = document.body.classList.contains("simulated");
  const MARK = "Simulated data: no human took part.";

  function button(label, act) {
    const made = document.createElement("button");
    made.type = "button";
    made.textContent = label;
    made.addEventListener("click", () => {
      act();
      made.textContent = "✓ " + label;
      setTimeout(() => { made.textContent = label; }, 2000);
    });
    return made;
  }

  function tools(...buttons) {
    const made = document.createElement("div");
    made.className = "tools";
    made.append(...buttons);
    return made;
  }

  function copy(plain, html) {
    const fill = (event) => {
      event.preventDefault();
      event.clipboardData.setData("text/plain", plain);
      event.clipboardData.setData("text/html", html);
    };
    document.addEventListener("copy", fill);
    document.execCommand("copy");
    document.removeEventListener("copy", fill);
  }

  function download(content, type, number, title, ending) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([content], { type }));
    const name = title.toLowerCase().replace(/[^\p{L}\p{N}]+/gu, "_").slice(0, 60);
    link.download = `${isSimulated ? "simulated_" : ""}${number}_${name}.${ending}`;
    link.click();
    URL.revokeObjectURL(link.href);
  }

  const safe = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;");
  const text = (cell) => cell.textContent.replace(/\u00a0/g, " ").trim();

  function grid(table) {
    return [...table.rows].map((row) => [...row.cells].flatMap((cell) =>
      [text(cell), ...Array(cell.colSpan - 1).fill("")]));
  }

  // Rows of headings become one: "group, name".
  function flat(table) {
    const rows = grid(table);
    const heads = table.tHead.rows.length;
    let group = "";
    const above = heads > 1 ? [...table.tHead.rows[0].cells].flatMap((cell) => Array(cell.colSpan).fill(text(cell))) : [];
    const names = rows[heads - 1].map((name, i) => { group = above[i] || ""; return group ? `${group}, ${name}` : name; });
    return [names, ...rows.slice(heads)];
  }

  function csv(table) {
    const quoted = (value) => (/[",\n]/.test(value) ? `"${value.replace(/"/g, '""')}"` : value);
    return flat(table).map((row, i) => [...row, i ? String(isSimulated) : "is_simulated"].map(quoted).join(",")).join("\n") + "\n";
  }

  // Three rules, the number and the title above, the note below (APA 7, section 7).
  function asApa(table, number, title, note) {
    const last = table.rows.length - 1, heads = table.tHead.rows.length;
    const rows = [...table.rows].map((row, i) => {
      const line = (i === 0 ? "border-top:1pt solid;" : "") + (i === heads - 1 || i === last ? "border-bottom:1pt solid;" : "");
      return "<tr>" + [...row.cells].map((cell) => `<td colspan="${cell.colSpan}" style="${line}padding:2pt 6pt;text-align:${getComputedStyle(cell).textAlign}">${safe(text(cell))}</td>`).join("") + "</tr>";
    });
    const below = [isSimulated ? MARK : "", note].filter(Boolean).join(" ");
    return `<p><b>Table ${number}</b></p><p><i>${safe(title)}</i></p><table style="border-collapse:collapse">${rows.join("")}</table>` +
      (below ? `<p><i>Note.</i> ${safe(below)}</p>` : "");
  }

  document.querySelectorAll(".table").forEach((place, i) => {
    const table = place.querySelector("table");
    const title = text(place.querySelector(".caption"));
    const note = place.querySelector(".note") ? text(place.querySelector(".note")) : "";
    const below = [isSimulated ? MARK : "", note].filter(Boolean).join(" ");
    const plain = `Table ${i + 1}\n${title}\n${grid(table).map((row) => row.join("\t")).join("\n")}\n${below ? `Note. ${below}\n` : ""}`;
    place.append(tools(
      button("Copy as APA", () => copy(plain, asApa(table, i + 1, title, note))),
      button("Download CSV", () => download("\ufeff" + csv(table), "text/csv", `table_${i + 1}`, title, "csv")),
    ));
  });

  // ---- figures as files, without what is hidden and whose a line is -------------------------------

  document.querySelectorAll("figure").forEach((place, i) => {
    const drawn = place.querySelector(".plot svg");
    if (!drawn) return;
    const title = text(place.querySelector("figcaption strong")).replace(/\.$/, "");
    const both = [button("Download SVG", () => {
      const taken = drawn.cloneNode(true);
      taken.querySelectorAll(".out, .all, [data-who] > title").forEach((hidden) => hidden.remove());
      taken.querySelectorAll("[data-who]").forEach((one) => one.removeAttribute("data-who"));
      download(new XMLSerializer().serializeToString(taken), "image/svg+xml", `figure_${i + 1}`, title, "svg");
    })];
    if (place.dataset.csv) both.push(button("Its data", () => download("\ufeff" + place.dataset.csv, "text/csv", `figure_${i + 1}`, title, "csv")));
    place.append(tools(...both));
  });

  // ---- trials whose pages are elsewhere: their command is copied ---------------------------------

  document.querySelectorAll("button[data-command]").forEach((trial) => {
    trial.addEventListener("click", () => {
      copy(trial.dataset.command, safe(trial.dataset.command));
      trial.classList.add("copied");
      setTimeout(() => trial.classList.remove("copied"), 2500);
    });
  });

  // ---- one participant through all panels, and those who do not count --------------------------

  const WHO = document.documentElement.lang.startsWith("de")
    ? { label: "Person hervorheben", all: "alle", out: "Wer nicht zählt, mit zeigen", note: "Mittelwerte bleiben die derer, die zählen.",
        lost: "Mit ausgelassenen Durchgängen zeigen, gepunktet", dotted: "Gepunktet: dieselbe Person mit allen beendeten Durchgängen.", look: ["Durchgang zum Ansehen", "Durchgänge zum Ansehen"] }
    : { label: "Highlight a participant", all: "everybody", out: "Show who was left out", note: "Means stay those of who counts.",
        lost: "Show with trials left out, dotted", dotted: "Dotted: the same person with every finished trial.", look: ["trial to look at", "trials to look at"] };
  const FOLDS = document.documentElement.lang.startsWith("de")
    ? { open: "Alle Tabellen öffnen", close: "Alle schließen" }
    : { open: "Open all tables", close: "Close all" };
  const drawn = [...document.querySelectorAll("svg [data-who]")];
  const people = [...new Set(drawn.map((group) => group.dataset.who))].sort();
  const of = (who) => drawn.filter((group) => group.dataset.who === who);
  const rows = [...document.querySelectorAll("tbody tr")].filter((row) => people.includes(text(row.cells[0])));
  let chosen = "";

  function light(who) {
    document.body.classList.toggle("lights-one", Boolean(who));
    document.querySelectorAll(".lit").forEach((lit) => lit.classList.remove("lit"));
    if (!who) return;
    of(who).forEach((group) => group.classList.add("lit"));
    rows.filter((row) => text(row.cells[0]) === who).forEach((row) => row.classList.add("lit"));
  }

  if (people.length) {
    const isOut = new Set(drawn.filter((group) => group.classList.contains("out")).map((group) => group.dataset.who));
    const place = document.createElement("div");
    place.className = "people-bar";
    place.setAttribute("role", "group");
    place.setAttribute("aria-label", WHO.label);
    const label = document.createElement("label");
    const choice = document.createElement("select");
    choice.append(new Option(WHO.all, ""), ...people.map((who) => new Option(isOut.has(who) ? `${who} ✕` : who, who)));
    label.append(`${WHO.label} `, choice);
    place.append(label);
    const trials = [...document.querySelectorAll("tr")].filter((row) => row.querySelector('[data-command], a[href^="views/"]'));
    const look = document.createElement("button");
    look.type = "button";
    look.className = "look";
    look.addEventListener("click", () => {
      const mine = trials.find((row) => text(row.cells[0]) === chosen);
      for (let fold = mine.closest("details"); fold; fold = fold.parentElement.closest("details")) fold.open = true;
      mine.scrollIntoView({ block: "center" });
      mine.querySelector("button, a").focus({ preventScroll: true });
    });
    const pick = (who) => {
      chosen = who;
      choice.value = who;
      light(who);
      const count = who ? trials.filter((row) => text(row.cells[0]) === who).length : 0;
      look.hidden = !count;
      look.textContent = `${count} ${WHO.look[count === 1 ? 0 : 1]}`;
    };
    look.hidden = true;
    choice.addEventListener("change", () => {
      if (isOut.has(choice.value)) shows(true);
      pick(choice.value);
    });
    const both = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    const shows = (is) => { box.checked = is; document.body.classList.toggle("with-out", is); };
    box.addEventListener("change", () => {
      shows(box.checked);
      if (!box.checked && isOut.has(chosen)) pick("");
    });
    if (isOut.size) {
      both.append(box, ` ${WHO.out} (${isOut.size})`);
      both.title = WHO.note;
      place.append(both);
    }
    const withLost = new Set(drawn.filter((group) => group.classList.contains("all")).map((group) => group.dataset.who));
    if (withLost.size) {
      const trialsToo = document.createElement("label"), ticked = document.createElement("input");
      ticked.type = "checkbox";
      ticked.addEventListener("change", () => document.body.classList.toggle("with-all", ticked.checked));
      trialsToo.append(ticked, ` ${WHO.lost} (${withLost.size})`);
      trialsToo.title = WHO.dotted;
      place.append(trialsToo);
    }
    place.append(look);
    document.querySelector("main").prepend(place);
    const at = (event) => (event.target instanceof Element ? event.target.closest("[data-who]") : null);
    document.addEventListener("pointerover", (event) => {
      const group = at(event);
      if (group && event.pointerType === "mouse") light(group.dataset.who);
    });
    document.addEventListener("pointerout", (event) => { if (at(event)) light(chosen); });
    document.addEventListener("click", (event) => {
      const group = at(event);
      if (group) pick(group.dataset.who === chosen ? "" : group.dataset.who);
    });
    document.addEventListener("keydown", (event) => { if (event.key === "Escape" && chosen) pick(""); });
  }

  // ---- all tables at once: to search the page, or to print them ------------------------------------

  const folds = [...document.querySelectorAll("main details")];
  if (folds.length) {
    const open = document.createElement("button");
    open.type = "button";
    open.textContent = FOLDS.open;
    open.addEventListener("click", () => {
      const opens = folds.some((fold) => !fold.open);
      folds.forEach((fold) => { fold.open = opens; });
      open.textContent = opens ? FOLDS.close : FOLDS.open;
    });
    document.querySelector("nav").append(open);
  }

  document.querySelectorAll(".verdict").forEach((place) => {
    const said = text(place.querySelector("p"));
    if (!said) return;
    const whole = isSimulated ? `${said} ${MARK}` : said;
    place.append(tools(button("Copy", () => copy(whole, safe(whole)))));
  });
})();
