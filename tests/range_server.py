"""`python range_server.py FOLDER LOG`: Python's file server with what it lacks, ranges of bytes.
Prints its port. A process of its own: GDAL waits for its answers without letting other Python
threads run. Ranges asked for go to LOG.
"""

import subprocess
import sys
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path


class RangeHandler(SimpleHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_GET(self):
        path, span = Path(self.translate_path(self.path)), self.headers.get("Range")
        if span is None or not path.is_file():
            return super().do_GET()
        first, last = span.removeprefix("bytes=").split("-")
        size = path.stat().st_size
        start, stop = int(first), min(int(last) + 1 if last else size, size)
        with Path(sys.argv[2]).open("a", encoding="utf-8") as log:
            log.write(f"{self.path} {start} {stop}\n")
        self.send_response(206 if start < stop else 416)
        if start < stop:
            self.send_header("Content-Range", f"bytes {start}-{stop - 1}/{size}")
        self.send_header("Content-Length", str(max(stop - start, 0)))
        self.end_headers()
        with path.open("rb") as file:
            file.seek(start)
            self.wfile.write(file.read(max(stop - start, 0)))
        return None

    def log_message(self, *_):
        pass

    def end_headers(self):
        self.send_header("Accept-Ranges", "bytes")
        super().end_headers()


@contextmanager
def serve(folder, log):
    """The address at which `folder` is served until the block ends."""
    process = subprocess.Popen(
        [sys.executable, __file__, str(folder), str(log)], stdout=subprocess.PIPE, text=True
    )
    try:
        yield f"http://127.0.0.1:{int(process.stdout.readline())}"
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


if __name__ == "__main__":
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(RangeHandler, directory=sys.argv[1]))
    print(server.server_port, flush=True)
    server.serve_forever()
