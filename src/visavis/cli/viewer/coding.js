// Coding: spans of the session with a label and a comment, by one coder, saved as a file for `visavis import annotations`.

const FIRST_LABELS = 'event';

class Coding {
  constructor(viewer) {
    this.viewer = viewer;
    const h = viewer.content.header;
    this.header = h;
    this.key = `visavis.coding ${h.study} ${h.participant} ${h.session} ${h.created}`;
    this.spans = []; this.open = null;
    $('coding-box').hidden = viewer.sessions.length > 1; // a span belongs to one session
    const stored = this.stored();
    this.spans = stored.spans || [];
    $('coder').value = stored.coder || '';
    $('code-labels').value = stored.labels || FIRST_LABELS;
    for (const id of ['coder', 'code-labels']) $(id).onchange = () => { this.store(); this.tell(); };
    $('mark').onclick = () => { this.mark(); $('mark').blur(); };
    $('save-codes').onclick = () => this.save();
    this.tell();
  }

  // What a browser keeps of an earlier look at this page; some keep nothing for files.
  stored() { try { return JSON.parse(localStorage.getItem(this.key)) || {}; } catch { return {}; } }
  store() {
    try { localStorage.setItem(this.key, JSON.stringify({spans: this.spans, coder: $('coder').value, labels: $('code-labels').value})); } catch { /* the page goes on without */ }
  }

  get labels() { return [...new Set($('code-labels').value.split(',').map(l => l.trim()).filter(Boolean))]; }

  // Begin a span at the moment shown; end it at the second press.
  mark() {
    if ($('coding-box').hidden) return;
    const t = this.viewer.t;
    $('coding-box').open = true;
    if (this.open === null) { this.open = t; this.tell(); return; }
    const [from, to] = [Math.min(this.open, t), Math.max(this.open, t)];
    this.open = null;
    if (to > from && this.partAt(from) === this.partAt(to)) {
      this.spans.push({from, to, label: this.labels[0] || FIRST_LABELS, comment: ''});
      this.spans.sort((a, b) => a.from - b.from);
    }
    this.store();
    this.tell();
  }

  partAt(t) { return this.header.parts.findLast(p => t >= p.t0) || this.header.parts[0]; }

  tell() {
    $('mark').textContent = this.open === null ? 'begin a span (A)' : `end the span begun at ${clockText(this.open)} (A)`;
    $('spans').replaceChildren(...this.spans.map((span, k) => {
      const row = document.createElement('div'), go = document.createElement('button'), label = document.createElement('select');
      const comment = document.createElement('input'), remove = document.createElement('button');
      row.className = 'span';
      go.textContent = `${clockText(span.from, 1)} – ${clockText(span.to, 1)}`;
      go.onclick = () => this.viewer.seek(span.from);
      for (const name of new Set([...this.labels, span.label])) label.append(new Option(name, name, false, name === span.label));
      label.setAttribute('aria-label', `Label of span ${k + 1}`);
      label.onchange = () => { span.label = label.value; this.store(); this.tell(); };
      comment.value = span.comment;
      comment.placeholder = 'comment';
      comment.setAttribute('aria-label', `Comment on span ${k + 1}`);
      comment.onchange = () => { span.comment = comment.value; this.store(); };
      remove.textContent = '×';
      remove.setAttribute('aria-label', `Remove span ${k + 1}`);
      remove.onclick = () => { this.spans.splice(k, 1); this.store(); this.tell(); };
      row.append(go, label, comment, remove);
      return row;
    }));
    $('save-codes').disabled = !this.spans.length || !$('coder').value.trim();
    $('save-codes').title = $('save-codes').disabled ? 'mark a span and say who codes' : '';
    this.viewer.line.coded = this.spans;
    this.viewer.line.viewKey = '';
    this.viewer.line.dirty = true;
  }

  csv() {
    const cell = value => { const text = String(value); return /[",\n\r]/.test(text) ? `"${text.replaceAll('"', '""').replace(/[\r\n]+/g, ' ')}"` : text; };
    const rows = this.spans.map(span => {
      const part = this.partAt(span.from), ns = t => Math.round((t - part.t0) * 1e9) + part.started_ns;
      return [this.header.study, this.header.participant, this.header.session, part.number, this.viewer.trialAt(span.from)?.id || '', $('coder').value.trim(), span.label, ns(span.from), ns(span.to), span.comment];
    });
    return [['study', 'participant', 'session', 'recording_part', 'trial_id', 'coder', 'label', 'begin_ns', 'end_ns', 'comment'], ...rows].map(row => row.map(cell).join(',')).join('\n') + '\n';
  }

  save() {
    const link = document.createElement('a'), h = this.header;
    link.href = URL.createObjectURL(new Blob([this.csv()], {type: 'text/csv'}));
    link.download = `${h.study}_${h.participant}_ses-${String(h.session).padStart(3, '0')}_${$('coder').value.trim().replace(/\W+/g, '-')}_annotations.csv`;
    link.click();
    URL.revokeObjectURL(link.href);
  }
}
