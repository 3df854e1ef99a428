"""Pictures of results in docs/img, made anew: python docs/site/result_pictures.py [FOLDER]

Runs the scenario of a hidden effect, copies what its verdict shows, and photographs report pages in an installed
Chromium. FOLDER (out/pictures) keeps verdicts and pages. The page of the paper's experiment is that of `make paper`.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import mujoco
from PIL import Image, ImageDraw
from playwright.sync_api import Browser, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
IMAGES, SCENARIOS = ROOT / "docs" / "img", ROOT / "scenarios"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-sync",
]
WIDTH, COLOURS = 1200, 256
DESKTOP, PHONE, ABOVE = (1400, 1094), (390, 844), 150
SEAM, BACKGROUND = 18, (212, 218, 225)
DRAWN = """[...document.querySelectorAll('.plot')]
    .filter((plot) => plot.offsetParent && plot.getBoundingClientRect().top < innerHeight)
    .every((plot) => plot.dataset.drawn)"""


def main(folder: Path) -> None:
    """Make all pictures."""
    paper = ROOT / "out" / "paper" / "report.html"
    if not paper.is_file():
        sys.exit(f"{paper} is not there; run 'make paper' first")
    folder.mkdir(parents=True, exist_ok=True)
    results(folder)
    copied(folder / "verdict")
    with sync_playwright() as started:
        path = next((found for name in BROWSERS if (found := shutil.which(name))), None)
        browser = started.chromium.launch(executable_path=path, args=FLAGS)
        verdict = folder / "verdict" / "report.html"
        shot(browser, verdict, DESKTOP, dark=True).save(IMAGES / "report_diagnosis.jpg", quality=85)
        shot(browser, paper, (1400, 941), at="Table II").save(IMAGES / "report_paper.jpg", quality=85)
        phones = [
            shot(browser, folder / "estimate" / "report.html", PHONE),
            shot(browser, paper, PHONE, at="Table II"),
            shot(browser, verdict, PHONE, at="What is named"),
        ]
        beside(phones).save(IMAGES / "report_phone.jpg", quality=85)
        first_minutes(folder, browser)
        browser.close()


def first_minutes(folder: Path, browser: Browser) -> None:
    """The arm of the tutorial, and the page of its verdict."""
    arm, example = ["mocobot-example/today.csv", "--model", "mocobot-example/arm.xml"], "mocobot-example"
    for words in (
        ["example", "arm"],
        ["map", *arm, "--out", f"{example}/log.toml"],
        ["diagnose", *arm, "--out", f"{example}/verdict"],
        ["report", f"{example}/verdict"],
    ):
        subprocess.run([sys.executable, "-m", "mocobot", *words, "--force"], check=True, cwd=folder)
    page = folder / example / "verdict" / "report.html"
    seen = shot(browser, page, (1100, 740), at="Measured and modelled torques")
    seen.save(IMAGES / "arm_torques.jpg", quality=80)
    model = mujoco.MjModel.from_xml_path(str(ROOT / "models" / "six_axis" / "scene.xml"))
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    data.qpos[:] = [0.6, 0.3, 1.2, 0.3, 0.4, 0.0]
    mujoco.mj_forward(model, data)
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = [0.15, 0.1, 0.35], 1.6, 150.0, -15.0
    with mujoco.Renderer(model, 420, 640) as renderer:
        renderer.update_scene(data, camera)
        Image.fromarray(renderer.render()).save(IMAGES / "arm.jpg", quality=85)


def results(folder: Path) -> None:
    """An estimate of a healthy team, and the verdict of the scenario; pages name files relative to the folder."""
    healthy = [f"healthy/trial{k}_{kind}.parquet" for k, kind in ((1, "random"), (2, "periodic"))]
    faulty = [f"hidden/trial{k}.parquet" for k in (1, 2)]
    mocobot = ("-m", "mocobot")
    for words in (
        [
            *mocobot,
            "simulate",
            "--payload",
            "b",
            "--trials",
            "random,periodic",
            "--out-dir",
            "healthy",
            "--force",
        ],
        [*mocobot, "estimate", *healthy, "--out", "estimate/est.json", "--force"],
        [str(SCENARIOS / "hidden_effect.py"), "hidden"],
        [*mocobot, "diagnose", *faulty, "--out", "verdict", "--pictures", "--force"],
        *([*mocobot, "report", part, "--force"] for part in ("estimate", "verdict")),
    ):
        subprocess.run([sys.executable, *words], check=True, cwd=folder)


def copied(verdict: Path) -> None:
    """Plots of the verdict, as wide as a page shows them."""
    residual = next(p for p in sorted(verdict.glob("residual_*.png")) if p.stem != "residual_against")
    sources = {
        "diagnosis_residual.png": residual,
        "diagnosis_closed_loop.png": verdict / "closed_loop.png",
    }
    for name, source in sources.items():
        picture = Image.open(source).convert("RGB")
        height = round(picture.height * WIDTH / picture.width)
        small = picture.resize((WIDTH, height), Image.Resampling.LANCZOS)
        small.quantize(COLOURS, dither=Image.Dither.NONE).save(IMAGES / name, optimize=True)


def shot(
    browser: Browser, page: Path, size: tuple[int, int], *, dark: bool = False, at: str | None = None
) -> Image.Image:
    """A page, from its beginning or from the first heading that holds some words."""
    width, height = size
    scheme = "dark" if dark else "light"
    # The page's policy forbids scripts from elsewhere, ours to wait with among them.
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme=scheme, bypass_csp=True
    )
    seen = context.new_page()
    seen.goto(page.as_uri())
    if at is not None:
        heading = seen.locator("h2, h3, h4, figcaption, caption, .title", has_text=at).first
        heading.evaluate("(here, above) => scrollBy(0, here.getBoundingClientRect().top - above)", ABOVE)
    seen.wait_for_timeout(1000)
    seen.wait_for_function(DRAWN, timeout=20_000)
    out = page.with_suffix(".png")
    seen.screenshot(path=out)
    context.close()
    with Image.open(out) as picture:
        taken = picture.convert("RGB")
    out.unlink()
    return taken


def beside(pictures: list[Image.Image]) -> Image.Image:
    """Pictures of one height side by side."""
    width = sum(p.width for p in pictures) + SEAM * (len(pictures) + 1)
    height = pictures[0].height + 2 * SEAM
    out = Image.new("RGB", (width, height), BACKGROUND)
    mask, left = ImageDraw.Draw(out), SEAM
    for picture in pictures:
        out.paste(picture, (left, SEAM))
        mask.rectangle((left, SEAM, left + picture.width - 1, SEAM + picture.height - 1), outline=BACKGROUND)
        left += picture.width + SEAM
    return out


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "out" / "pictures"))
