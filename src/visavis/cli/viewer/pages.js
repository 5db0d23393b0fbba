// Trials on a page in a browser: films in time, the question below, and the answer as it was given.

const AHEAD = 12; // pictures of a film on either side of the one that is seen that are kept
const MARKED_S = 0.5; // a page goes on with the answer: it is marked this much before

class Pages {
  constructor(content, drawing) {
    this.steps = content.header.pages;
    this.films = content.header.films.map(film => ({...film, pictures: new Map(), missing: new Set()}));
    this.content = content;
    this.drawing = drawing;
  }

  at(t) { return this.steps.find(s => t >= s.t0 && t < s.t1) || null; }

  // The picture of a film at a moment, decoded when first needed; until then, or where it cannot be, the nearest before it.
  picture(film, seconds) {
    const k = Math.min(film.frames.length - 1, Math.floor((seconds % film.seconds) * film.rate));
    if (film.at !== k) {
      film.at = k;
      for (const [n, image] of film.pictures) if (Math.abs(n - k) > AHEAD) { image?.close(); film.pictures.delete(n); }
    }
    if (!film.pictures.has(k) && !film.missing.has(k)) {
      film.pictures.set(k, null);
      this.drawing.wait(this.content.picture(film.frames[k]).then(image => {
        if (!image) film.missing.add(k);
        if (!image || !film.pictures.has(k)) { image?.close(); film.pictures.delete(k); return; }
        film.pictures.get(k)?.close(); // asked for twice
        film.pictures.set(k, image);
      }));
    }
    for (let n = k; n >= k - AHEAD; n--) if (film.pictures.get(n)) return film.pictures.get(n);
    return null;
  }

  // Which pictures of a step's films are missing, of those that were asked for.
  notesAt(step) {
    return step.films.map(n => this.films[n]).filter(film => film.missing.size).map(film =>
      `no picture of the film at ${momentsInWords(film.missing, k => k / film.rate)} (the page, or a file beside it, is damaged or gone); the one before it stays`);
  }

  draw(g, step, t, width, height) {
    g.fillStyle = '#fafaf8';
    g.fillRect(0, 0, width, height);
    const font = Math.max(11, height / 28);
    g.textAlign = 'center';
    g.textBaseline = 'middle';
    g.fillStyle = '#1e1e20';
    g.font = `${font}px system-ui, sans-serif`;
    g.fillText(step.caption, width / 2, 0.05 * height, 0.96 * width);
    const films = step.films.map(k => this.films[k]), gap = width / 60, tall = 0.66 * height;
    const all = films.reduce((s, f) => s + f.width / f.height, 0);
    const size = Math.min(tall, (0.96 * width - gap * (films.length - 1)) / Math.max(all, 1e-6));
    let x = (width - all * size - gap * (films.length - 1)) / 2;
    if (t >= step.on) for (const film of films) {
      const image = this.picture(film, t - step.on), wide = size * film.width / film.height;
      if (image) g.drawImage(image, x, 0.09 * height, wide, size);
      x += wide + gap;
    }
    let y = films.length ? 0.13 * height + size : 0.3 * height;
    for (const question of step.questions) y = this.question(g, question, t, y, width, font);
  }

  question(g, question, t, y, width, font) {
    const line = 1.35 * font, isAnswered = question.at !== null && t >= question.at - MARKED_S;
    g.fillStyle = '#1e1e20';
    g.font = `${font}px system-ui, sans-serif`;
    g.fillText(question.prompt, width / 2, y, 0.96 * width);
    const options = question.options.length ? question.options.map(([value, label]) => [label, isAnswered && value === question.answer]) : [[isAnswered ? question.answer || '' : '…', isAnswered]];
    let size = font, widths;
    do {
      g.font = `${size}px system-ui, sans-serif`;
      widths = options.map(([label]) => g.measureText(label).width + 1.6 * size);
      size -= 1;
    } while (size > 6 && widths.reduce((a, b) => a + b, 0) > 0.96 * width);
    let x = (width - widths.reduce((a, b) => a + b, 0)) / 2;
    options.forEach(([label, lit], k) => {
      g.beginPath();
      g.roundRect(x + 3, y + 0.75 * line, widths[k] - 6, 1.1 * line, 5);
      g.fillStyle = '#2668ad';
      if (lit) g.fill();
      g.strokeStyle = lit ? '#2668ad' : '#787a7e';
      g.lineWidth = 1;
      g.stroke();
      g.fillStyle = lit ? '#fafaf8' : '#1e1e20';
      g.fillText(label, x + widths[k] / 2, y + 1.3 * line);
      x += widths[k];
    });
    return y + 2.6 * line;
  }
}
