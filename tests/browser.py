"""Pages in headless Chromium: clicks and slider moves, and what the page then shows."""

import html
import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
BROWSER = next(filter(None, map(shutil.which, NAMES)), None)
NODE = shutil.which("node")
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--virtual-time-budget=60000", "--window-size=1200,900", "--dump-dom"),
)
TRIES = 3  # on a busy machine the browser may leave before the page has come to rest
DRIVER = """
<pre id="seen"></pre>
<script>
(() => {
  const find = (id) => document.getElementById(id);
  const bars = [...document.querySelectorAll("input[type=range]")];
  const of = (read) => Object.fromEntries(bars.map((bar) => [bar.id, read(bar)]));
  const look = () => ({
    drag: find("cd").textContent,
    reference: find("reference-cd").textContent,
    difference: find("difference").textContent,
    lift: Object.fromEntries(["cl", "cm", "ratio"].map((id) => [id, find(id).textContent])),
    seen: ["cl", "glide", "lift"].filter((id) => find(id).getClientRects().length),
    byChord: find("by-chord").getClientRects().length ? find("by-chord").textContent : "",
    force: find("force").getAttribute("d"),
    best: find("best-glide").textContent,
    curves: ["cl-curve", "glide-curve"].map((id) => find(id).innerHTML),
    warned: getComputedStyle(find("warning")).visibility === "visible",
    download: !find("download").disabled,
    shape: find("shape").getAttribute("d"),
    values: of((bar) => Number(bar.value)),
    spoken: of((bar) => bar.getAttribute("aria-valuetext")),
    shown: of((bar) => find(`${bar.id}-value`).value),
  });
  async function settled() {
    for (let before = ""; before !== JSON.stringify(look()); ) {
      before = JSON.stringify(look());
      await new Promise((resolve) => setTimeout(resolve, 100));
    }
    return look();
  }
  const acts = {
    click: (id) => find(id).click(),
    press: (id, key) => find(id).dispatchEvent(new KeyboardEvent("keydown", { key })),
    type: (id, text) => {
      find(`${id}-value`).value = text;
      find(`${id}-value`).dispatchEvent(new Event("change"));
    },
    set: (id, value) => {
      find(id).value = value;
      find(id).dispatchEvent(new Event("input"));
    },
  };
  let saved = null;
  window.requestAnimationFrame = (draw) => setTimeout(draw, 16); // virtual time has few frames
  URL.createObjectURL = (blob) => ((saved = blob), "#");
  async function drive(scenes) {
    const states = { opened: await settled() };
    for (const [name, steps] of Object.entries(scenes)) {
      for (const [act, ...what] of steps) {
        acts[act](...what);
        states[name] = await settled();
      }
    }
    return { states, saved: saved && (await saved.text()), computed: COMPUTED };
  }
  drive(SCENES).then((seen) => (find("seen").textContent = JSON.stringify(seen)));
})();
</script>
"""


def visit(page: str, scenes: dict[str, list], expression: str) -> dict[str, Any]:
    """Open a page in Chromium and go through scenes, lists of steps such as ("click", "least").

    Returns what the page showed after each (``states``, the first is ``opened``), the text of the
    last file that it offered (``saved``), and the value of an ``expression`` (``computed``).
    """
    driver = DRIVER.replace("SCENES", json.dumps(scenes)).replace("COMPUTED", expression)
    for _ in range(TRIES):
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            path = Path(folder, "page.html")
            path.write_text(page.replace("</body>", driver + "</body>"), encoding="utf-8")
            command = [BROWSER, *FLAGS, f"--user-data-dir={folder}/user", path.as_uri()]
            done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
        if seen := re.search(r'<pre id="seen">(.+?)</pre>', done.stdout, re.DOTALL):
            return json.loads(html.unescape(seen[1]))
    raise AssertionError("the page's script failed, or did not come to rest")


def compute(scripts: dict[str, str], expression: str) -> Any:
    """Value of an expression in ``model``, made by the page's scripts, in node."""
    program = (
        f"const data = {scripts['data']};\n{scripts['model']}\n"
        f"const model = makeModel(data);\nconsole.log(JSON.stringify({expression}));\n"
    )
    done = subprocess.run(
        [NODE, "-"], input=program, capture_output=True, text=True, check=True, timeout=60
    )
    return json.loads(done.stdout)
