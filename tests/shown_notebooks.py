"""Notebooks as their readers see them: in a JupyterLab of its own and as nbconvert's page, and what is wrong."""

import contextlib
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from nbconvert import HTMLExporter
from playwright.sync_api import Page

from build import copy_mathjax

#: Both front ends name their parts alike. A formula that is set is an ``mjx-container``.
TROUBLES = r"""() => {
  const found = [];
  const cut = (text, at) => `…${text.slice(Math.max(0, at - 30), at + 40)}…`;
  for (const block of document.querySelectorAll('.jp-RenderedMarkdown, .jp-RenderedHTML')) {
    const copy = block.cloneNode(true);
    copy.querySelectorAll('pre, code, script, style, svg, mjx-container, iframe').forEach((node) => node.remove());
    const text = copy.textContent;
    const raw = /:::|\{[\w:-]+\}|^:[\w-]+: |^\([\w-]+\)=$|\$|\\[A-Za-z(\[]|[_^]\{|\]\(|\*\*|<\/?[a-z]/m.exec(text);
    if (raw) found.push(`raw ${raw[0]}: ${cut(text, raw.index)}`);
    for (const link of block.querySelectorAll('a[href]')) {
      if (/^(Section|Figure|Table|Equation|Theorem|Definition|Lemma|Proposition|Corollary|Example|Algorithm)$/
        .test(link.textContent.trim())) found.push(`no number: ${link.outerHTML}`);
      const leads = link.getAttribute('href');
      if (!leads.startsWith('#') || link.textContent === '¶') continue;
      const id = CSS.escape(decodeURIComponent(leads.slice(1)));
      if (!document.querySelector(`[id="${id}"], [data-jupyter-id="${id}"]`)) found.push(`no place: ${leads}`);
    }
  }
  for (const formula of document.querySelectorAll('mjx-container')) {
    const red = [...formula.querySelectorAll('*')].find((part) => getComputedStyle(part).color === 'rgb(255, 0, 0)');
    if (formula.querySelector('mjx-merror') || red)
      found.push(`formula: ${(red || formula).textContent} in ${formula.closest('.jp-Cell').textContent.slice(0, 60)}`);
  }
  const cells = [...document.querySelectorAll('.jp-Cell')];
  for (const picture of document.querySelectorAll('.jp-Cell img')) {
    const said = picture.alt && !picture.alt.startsWith('No description') ? picture.alt : '';
    const next = cells[cells.indexOf(picture.closest('.jp-Cell')) + 1];
    const told = [...((next && next.querySelectorAll('details')) || [])].map((part) => part.textContent).join('');
    if (`${said}${told}`.trim().split(/\s+/).length < 6) found.push(`no words: ${picture.outerHTML.slice(0, 60)}`);
  }
  return found;
}"""
SETTINGS = {"@jupyterlab/notebook-extension/tracker": {"windowingMode": "none"}}


@contextlib.contextmanager
def jupyter_lab(folder: Path) -> Iterator[str]:
    """The address of a JupyterLab without extensions that shows a folder, all cells of a notebook at once."""
    with tempfile.TemporaryDirectory(prefix="lab-") as home, socket.socket() as free:
        for name, values in SETTINGS.items():
            file = Path(home, "settings", f"{name}.jupyterlab-settings")
            file.parent.mkdir(parents=True)
            file.write_text(json.dumps(values), encoding="utf-8")
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
        free.close()
        names = ("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "JUPYTERLAB_WORKSPACES_DIR", "HOME")
        own = {name: f"{home}/{name}" for name in names} | {"JUPYTERLAB_SETTINGS_DIR": f"{home}/settings"}
        command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", f"--port={port}"]
        command += ["--ServerApp.port_retries=0", "--IdentityProvider.token=", "--ServerApp.disable_check_xsrf=True"]
        command += [f"--ServerApp.root_dir={folder}"]
        with Path(home, "log").open("w+") as log:
            server = subprocess.Popen(command, env=os.environ | own, stdout=log, stderr=log)
            try:
                deadline = time.monotonic() + 120
                while not _answers(port):
                    if server.poll() is not None or time.monotonic() > deadline:
                        log.seek(0)
                        raise OSError(f"JupyterLab does not start:\n{log.read()}")
                    time.sleep(0.2)
                yield f"http://127.0.0.1:{port}"
            finally:
                server.terminate()
                server.wait()


def _answers(port: int) -> bool:
    with socket.socket() as caller:
        return caller.connect_ex(("127.0.0.1", port)) == 0


def open_in_lab(page: Page, address: str, notebook: Path) -> None:
    """Open a notebook of the folder that JupyterLab shows, and wait until every text and formula is set."""
    for kernel in page.request.get(f"{address}/api/kernels").json():  # of the notebook before
        page.request.delete(f"{address}/api/kernels/{kernel['id']}")
    n_cells = len(json.loads(notebook.read_text(encoding="utf-8"))["cells"])
    page.goto(f"{address}/doc/tree/{notebook.name}")
    page.wait_for_function(f"() => document.querySelectorAll('.jp-Cell').length === {n_cells}", timeout=120_000)
    settle(page)


def page_of(notebook: Path, folder: Path) -> Path:
    """The page that nbconvert makes of a notebook, with the MathJax of the book in place of one from a network."""
    if not (folder / "mathjax.js").exists():
        copy_mathjax(folder / "mathjax")
        tex = {"inlineMath": [["$", "$"], ["\\(", "\\)"]]}  # as nbconvert sets them
        settings = {"tex": tex, "chtml": {"fontURL": "mathjax/output/chtml/fonts/woff-v2"}}
        script = (folder / "mathjax" / "tex-chtml.js").read_text(encoding="utf-8")
        (folder / "mathjax.js").write_text(f"window.MathJax = {json.dumps(settings)};\n{script}", encoding="utf-8")
    text, _ = HTMLExporter(mathjax_url="mathjax.js", require_js_url="").from_filename(str(notebook))
    file = folder / f"{notebook.stem}.html"
    file.write_text(text, encoding="utf-8")
    return file


def settle(page: Page) -> None:
    """Wait until the page has not changed for a second."""
    page.evaluate("""() => new Promise((done) => {
        let timer = setTimeout(done, 1000);
        new MutationObserver(() => { clearTimeout(timer); timer = setTimeout(done, 1000); })
            .observe(document.body, { childList: true, subtree: true });
    })""")


def troubles_of(page: Page) -> list[str]:
    """What a reader of the open notebook would stumble over."""
    return page.evaluate(TROUBLES)
