// Files that a page needs, asked for again where one does not come whole.

const TRIES = 4;

export const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

// What `take` makes of a file's content, with how it came; `ask` asks the server for it.
export async function loaded(ask, bytes, take) {
  let why = "";
  for (let attempt = 1; attempt <= TRIES; attempt += 1) {
    const startMs = performance.now();
    try {
      const response = await ask();
      if (!response.ok) throw new Error(`the server answered ${response.status}`);
      const buffer = await response.arrayBuffer();
      if (buffer.byteLength !== bytes) throw new Error("it came in part");
      const { report, ...content } = await take(buffer);
      return { ...content, report: { attempts: attempt, ms: performance.now() - startMs, ...report } };
    } catch (error) {
      why = String(error.message || error);
      await pause(300 * 2 ** (attempt - 1));
    }
  }
  throw new Error(why);
}
