// Six digits that open a page: nobody types a long address in a headset.

import { post } from "./wire.js";

const DIGITS = 6;
const field = document.getElementById("code");
const go = document.getElementById("go");
const digits = () => field.value.replace(/\D/g, "");

async function open() {
  go.disabled = true;
  try {
    const { body } = await post("/api/open", "", { code: digits() });
    if (body.page) { location.replace(body.page); return; }
    document.getElementById("notice").textContent = body.refused;
  } catch {
    document.getElementById("notice").textContent = "Nothing answers: look whether the page is still served.";
  }
  go.disabled = false;
}

field.addEventListener("input", () => { go.disabled = digits().length !== DIGITS; });
field.addEventListener("keydown", (e) => { if (e.key === "Enter" && !e.repeat && !go.disabled) go.click(); });
go.addEventListener("click", open);
