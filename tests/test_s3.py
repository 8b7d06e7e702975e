"""Data sets on a local S3 server, whose writers are killed.

Needs a server and a client: `uv run --with 'moto[s3,server]' --with s3fs pytest tests/test_s3.py`; without them the
tests are skipped.
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from typing import TYPE_CHECKING, Any

import pytest

from strips_lm import remote
from strips_lm.cli import main
from test_storage import SMALL

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

MORE = [*SMALL, "--pairs=400"]
REASON = "no S3: uv run --with 'moto[s3,server]' --with s3fs pytest tests/test_s3.py"
KILLS = 10

pytestmark = pytest.mark.filterwarnings("default")  # what the client and the server warn of is not ours


@pytest.fixture(scope="module")
def s3() -> Iterator[Any]:
    """A client of an S3 server on this machine, with an empty bucket `plans`; writers find it in the environment."""
    moto = pytest.importorskip("moto.server", reason=REASON)
    s3fs = pytest.importorskip("s3fs", reason=REASON)
    server = moto.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AWS_ENDPOINT_URL", f"http://{host}:{port}")
        patch.setenv("AWS_ACCESS_KEY_ID", "test")
        patch.setenv("AWS_SECRET_ACCESS_KEY", "test")
        patch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        files = s3fs.S3FileSystem(use_listings_cache=False)
        files.mkdir("plans")
        yield files
    server.stop()


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The data set as a local folder has it."""
    out = tmp_path_factory.mktemp("local") / "set"
    assert main(["gen-data", f"--out={out}", *MORE]) == 0
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in out.rglob("*") if path.is_file()}


def contents(s3: Any, root: str) -> dict[str, bytes]:
    """Every object under the root."""
    s3.invalidate_cache()
    return {path.removeprefix(f"{root}/"): s3.cat_file(path) for path in s3.find(root)}


def test_a_bucket_gets_the_bytes_of_a_local_folder(s3: Any, local: dict[str, bytes]) -> None:
    assert main(["gen-data", "--out=s3://plans/whole", *MORE]) == 0
    assert contents(s3, "plans/whole") == local


def test_a_bucket_that_is_not_there_is_told_and_not_made(s3: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["gen-data", "--out=s3://nosuch/set", *MORE]) == 2
    message = capsys.readouterr().err
    assert message.startswith("error: s3://nosuch/set")
    assert "Traceback" not in message
    assert not s3.exists("nosuch")


def test_killed_writers_leave_whole_objects_and_the_last_one_the_same_bytes(
    s3: Any, local: dict[str, bytes], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    patient = "from strips_lm import remote; remote.BEAT, remote.PATIENCE = 0.1, 0.5"
    code = f"{patient}; import sys; from strips_lm.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", code, "gen-data", "--out=s3://plans/killed", *MORE]
    draw, killed, seconds = random.Random(7), 0, 5.0
    while killed < KILLS:
        with (tmp_path / "log").open("ab") as log:
            start = time.monotonic()
            run = subprocess.Popen(command, stderr=log)
            try:
                run.wait(draw.uniform(0.3, 1.0) * seconds)
                seconds = time.monotonic() - start
                assert run.returncode == 0, (tmp_path / "log").read_text()
            except subprocess.TimeoutExpired:
                run.send_signal(signal.SIGKILL)
                run.wait()
                killed += 1
        found = {name: content for name, content in contents(s3, "plans/killed").items() if name != ".lock"}
        assert found == {name: local[name] for name in found}
        if "manifest.json" in found:  # work to be killed in
            s3.rm("plans/killed", recursive=True)
    monkeypatch.setattr(remote, "PATIENCE", 1.0)
    assert main(["gen-data", "--out=s3://plans/killed", *MORE]) == 0
    assert contents(s3, "plans/killed") == local
