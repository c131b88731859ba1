# Graupel for NVIDIA GPUs and CPUs (docs/guide/package.md). Training runs on the CPU.
#   docker build -f cmake/docker/cuda.Dockerfile -t graupel-cuda .
#   docker build --build-arg ARCHITECTURES=90a-real ...      for H100 and H200 alone: a third of the time
#   docker run --rm --gpus all graupel-cuda doctor
FROM debian:12-slim AS build
RUN apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
      g++ cmake ninja-build file dpkg-dev python3 python3-pip ca-certificates \
      libopenvdb-dev libnanovdb-dev libboost-iostreams-dev libtbb-dev libhdf5-dev libpng-dev zlib1g-dev libdeflate-dev \
      libeigen3-dev libopenblas-dev libopenblas0-openmp \
      libcli11-dev libfmt-dev nlohmann-json3-dev libtinyobjloader-dev librandom123-dev \
      libtorch-dev libgloo-dev && \
    rm -rf /var/lib/apt/lists/*
# Debian 12 has no nvcc that knows C++20: NVIDIA's from PyPI, laid out as its installers do.
RUN python3 -m pip install --no-cache-dir --no-deps --target /opt/wheels \
      nvidia-cuda-nvcc==13.0.88 nvidia-cuda-crt==13.0.88 nvidia-nvvm==13.0.88 \
      nvidia-cuda-runtime==13.0.96 nvidia-cuda-cccl==13.0.85 && \
    mv /opt/wheels/nvidia/cu13 /usr/local/cuda && rm -rf /opt/wheels && \
    ln -s lib /usr/local/cuda/lib64 && ln -s libcudart.so.13 /usr/local/cuda/lib/libcudart.so
WORKDIR /src
COPY . .
# Compute capability 8.0 and later. The driver comes from the host; the runtime is linked in.
ARG ARCHITECTURES="80-real;90a-real;90-virtual"
RUN cmake --preset deb -DGRAUPEL_TRAINING=ON -DGRAUPEL_CUDA=ON -DCMAKE_CUDA_RUNTIME_LIBRARY=Static \
      -DCMAKE_CUDA_ARCHITECTURES="$ARCHITECTURES" && \
    cmake --build --preset deb && cd build-deb && cpack

FROM debian:12-slim
# The package brings the libraries; Python is for 'graupel convert', ffmpeg for films.
RUN --mount=type=bind,from=build,source=/src/build-deb,target=/packages \
    apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
      /packages/graupel_*_amd64.deb python3 python3-numpy python3-h5py ffmpeg && \
    rm -rf /var/lib/apt/lists/* && \
    useradd --create-home graupel && mkdir /data && chown graupel /data
# What NVIDIA's container runtime hands in: the driver's libraries and nvidia-smi.
ENV NVIDIA_VISIBLE_DEVICES=all NVIDIA_DRIVER_CAPABILITIES=compute,utility
USER graupel
WORKDIR /data
ENTRYPOINT ["graupel"]
CMD ["--help"]
