# syntax=docker/dockerfile:1
#
#   docker build -t warpsplat .
#   docker run --rm -u "$(id -u):$(id -g)" -v "$PWD:/images" warpsplat vectorize photo.jpg
#
#   docker build -t warpsplat:cuda --target cuda .        # needs the NVIDIA container toolkit where it runs
#   docker run --rm --gpus all -v warpsplat-kernels:/var/cache/warpsplat -v "$PWD:/images" warpsplat:cuda ...

ARG PYTHON=3.12

FROM python:${PYTHON}-slim AS build
ARG EXTRAS=pdf
WORKDIR /source
COPY . .
RUN python -m venv /opt/warpsplat \
    && /opt/warpsplat/bin/pip install --no-cache-dir ".[${EXTRAS}]"

FROM python:${PYTHON}-slim AS cpu
COPY --from=build /opt/warpsplat /opt/warpsplat
ENV PATH=/opt/warpsplat/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    WARP_CACHE_PATH=/var/cache/warpsplat
RUN useradd --uid 1000 --create-home warpsplat \
    && install --directory --owner=warpsplat --mode=1777 /var/cache/warpsplat /images
USER warpsplat
# Kernels for the CPU are compiled here, once, and whoever runs the image may add others. Those for a GPU are compiled
# where there is one: Warp's wheel brings its compiler along, so that no image of CUDA is needed.
RUN --mount=type=bind,source=docs/images/cat.jpg,target=/tmp/cat.jpg \
    warpsplat doctor --device cpu \
    && for options in "--paint auto" "--open" "--layered" "--subject drawing" "--subject line"; do \
           warpsplat vectorize /tmp/cat.jpg -o /tmp/cat.svg -q --quality draft --iterations 30 --curves 32 $options \
           || exit 1; \
       done \
    && rm /tmp/cat.svg && chmod -R a+rwX /var/cache/warpsplat
WORKDIR /images
ENTRYPOINT ["warpsplat"]
CMD ["--help"]

FROM cpu AS cuda
ENV NVIDIA_VISIBLE_DEVICES=all \
    NVIDIA_DRIVER_CAPABILITIES=compute,utility

# What is built without a target.
FROM cpu
