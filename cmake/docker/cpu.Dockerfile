# Graupel for CPUs, with training by Debian's libtorch (docs/guide/package.md):
#   docker build -f cmake/docker/cpu.Dockerfile -t graupel .
#   docker run --rm graupel doctor
FROM debian:12-slim AS build
RUN apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
      g++ cmake ninja-build file dpkg-dev python3 \
      libopenvdb-dev libnanovdb-dev libboost-iostreams-dev libtbb-dev libhdf5-dev libpng-dev zlib1g-dev libdeflate-dev \
      libeigen3-dev libopenblas-dev libopenblas0-openmp \
      libcli11-dev libfmt-dev nlohmann-json3-dev libtinyobjloader-dev librandom123-dev \
      libtorch-dev libgloo-dev && \
    rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY . .
RUN cmake --preset deb -DGRAUPEL_TRAINING=ON && cmake --build --preset deb && cd build-deb && cpack

FROM debian:12-slim
# The package brings the libraries; Python is for 'graupel convert', ffmpeg for films.
RUN --mount=type=bind,from=build,source=/src/build-deb,target=/packages \
    apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
      /packages/graupel_*_amd64.deb python3 python3-numpy python3-h5py ffmpeg && \
    rm -rf /var/lib/apt/lists/* && \
    useradd --create-home graupel && mkdir /data && chown graupel /data
USER graupel
WORKDIR /data
ENTRYPOINT ["graupel"]
CMD ["--help"]
