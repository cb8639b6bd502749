"""Make the pictures of ``klack app`` and ``klack show``: ``python docs/app_pictures.py``.

The pages are those of ``PICTURED`` in ``tests/browser_pages.py``, of a folder that is computed
for them.  What has to be on each picture, its headings, buttons and boxes, is kept in
``images/app-pictures.json``; ``tests/interface/test_app_pages.py`` compares that with the pages.
Pixels are not compared: letters differ from machine to machine.
"""

import io
import json
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import sync_playwright

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
os.environ.setdefault("OMP_NUM_THREADS", "1")

from browser_pages import PICTURED, controls, launched, made_folder
from served_app import Served

IMAGES = Path(__file__).parent / "images"
SIZE = {"width": 1120, "height": 800}
COLOURS = 256


def main() -> None:
    """Open each page and draw it."""
    seen = {}
    with TemporaryDirectory() as place, sync_playwright() as driver:
        folder = Path(place) / "valves"  # its name is on every page
        folder.mkdir()
        made_folder(folder)
        browser = launched(driver)
        page = browser.new_page(viewport=SIZE)
        page.set_default_timeout(300_000)
        with Served(folder) as server:
            page.goto(server.address)
            page.wait_for_selector("#k-body")
            for item in PICTURED:
                page.emulate_media(reduced_motion="no-preference")
                item.open(page, server.base, folder)
                page.wait_for_timeout(3000)  # charts and scenes are drawn
                seen[item.picture] = controls(page)
                drawn = Image.open(io.BytesIO(page.screenshot()))
                drawn = drawn.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
                drawn.save(IMAGES / f"{item.picture}.png", optimize=True)
        browser.close()
    text = json.dumps(seen, indent=1, ensure_ascii=False)
    (IMAGES / "app-pictures.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
