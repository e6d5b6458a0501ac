"""The Dask cluster that a sweep starts for itself: nobody without its key may use it, for who may, runs any code."""
import ssl
import sys
import urllib.error
import urllib.request

import distributed
import pytest

from mitsonar.sweep.pools import cluster as module
from mitsonar.sweep.pools.cluster import Cluster

PAGES = ("info/main/workers.html", "json/counts.json", "health", "metrics", "api/v1/get_workers")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory, dask_workers):
    folder = str(tmp_path_factory.mktemp("sweep"))
    with Cluster(2, folder, folder, workers=1) as cluster:
        yield cluster


def test_without_dask_a_sentence_names_the_extra(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(ValueError, match=r"Dask is not installed; run pip install 'mitsonar\[cluster\]', or sweep"):
        Cluster(2, str(tmp_path), str(tmp_path), workers=1)


@pytest.fixture(scope="module")
def addresses(cluster):
    """Where the scheduler, the worker, and the process that watches the worker listen."""
    (worker, told), = cluster._client.scheduler_info()["workers"].items()
    return cluster._client.scheduler.address, worker, told["nanny"]


def test_it_does_what_it_is_asked(cluster):
    assert cluster._client.submit(sum, (1, 2)).result(timeout=30) == 3


def test_all_of_it_listens_on_this_machine_by_tls(addresses):
    assert [address.rpartition(":")[0] for address in addresses] == ["tls://127.0.0.1"] * 3


@pytest.mark.parametrize("who", range(3), ids=("scheduler", "worker", "watcher"))
@pytest.mark.parametrize("key", ["no key", "a key of one's own"])
def test_it_does_not_talk_to_others(cluster, addresses, who, key):
    address, options = addresses[who], {}
    if key == "no key":
        address = address.replace("tls", "tcp")
    else:
        options = distributed.Security.temporary().get_connection_args("client")
        options["ssl_context"].verify_mode = ssl.CERT_NONE         # who breaks in does not ask whom

    async def ask():
        comm = await distributed.comm.connect(address, timeout=3, **options)
        await comm.write({"op": "identity", "reply": True})
        return await comm.read()

    with pytest.raises(OSError):
        cluster._client.sync(ask, callback_timeout=20)


def test_it_serves_no_pages(cluster, addresses):
    info = cluster._client.scheduler_info()
    ports = [info["services"]["dashboard"], info["workers"][addresses[1]]["services"]["dashboard"]]
    for port in ports:
        for page in PAGES:
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(f"http://127.0.0.1:{port}/{page}", timeout=10)


def test_workers_that_cannot_be_started_are_one_sentence(monkeypatch, tmp_path):
    def start(*_):
        broken = AssertionError("init")                # as Dask does
        broken.__context__ = OSError(28, "No space left on device")
        raise RuntimeError("Nanny failed to start.") from broken

    monkeypatch.setattr(module, "_start", start)
    with pytest.raises(ValueError) as caught:
        Cluster(2, str(tmp_path), str(tmp_path), workers=1)
    assert str(caught.value) == (
        "the Dask workers could not be started: [Errno 28] No space left on device (if the disk is not full, /dev/shm "
        "may be, which holds their semaphores); sweep without --workers, or with --processes")
