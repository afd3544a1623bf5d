# hiproof, compiled: runs start at once, on any x86-64 processor since about 2015 (AVX2).
#
#     docker build -t hiproof .
#     docker run --rm --user "$(id -u)" -v "$PWD:/data" hiproof reconstruct tile.laz --footprints footprints.gpkg --out models
FROM python:3.13-slim AS built
# code for one kind of processor, not for the one that the image happens to be made on: it would be compiled again elsewhere
ENV NUMBA_CPU_NAME=x86-64-v3 NUMBA_CPU_FEATURES=""
COPY . /source
RUN python -m venv /opt/hiproof \
 && /opt/hiproof/bin/pip install --no-cache-dir "/source[all]" \
 && /opt/hiproof/bin/hiproof warm

FROM python:3.13-slim
# what GDAL's and rasterio's wheels expect of the system
RUN apt-get update && apt-get install -y --no-install-recommends libexpat1 && rm -rf /var/lib/apt/lists/* \
 && useradd --create-home hiproof && mkdir /data && chown hiproof /data
COPY --from=built /opt/hiproof /opt/hiproof
ENV NUMBA_CPU_NAME=x86-64-v3 NUMBA_CPU_FEATURES="" OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
USER hiproof
WORKDIR /data
ENTRYPOINT ["/opt/hiproof/bin/hiproof"]
