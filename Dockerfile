# Both distributions on a CPU, kernels compiled: docker build -t drive-robust --build-arg VERSION=1.2.3 .
#   docker run --rm -v "$PWD:/work" --user "$(id -u):$(id -g)" -e HOME=/tmp drive-robust pytest --drive-robust robustness
FROM python:3.12-slim-bookworm AS wheels
# git's history stays outside (.dockerignore), and with it the version
ARG VERSION=0.1.0.dev0
ENV SETUPTOOLS_SCM_PRETEND_VERSION=$VERSION PIP_DISABLE_PIP_VERSION_CHECK=1
WORKDIR /source
COPY . .
RUN pip wheel -q --no-cache-dir --no-deps --wheel-dir /wheels . ./agents

FROM python:3.12-slim-bookworm
# Kernels for any processor of this architecture: those for the one that builds would be compiled again elsewhere.
# Episodes have the same bits either way. Everybody may read and add kernels, whatever --user says.
ENV NUMBA_CPU_NAME=generic \
    NUMBA_CACHE_DIR=/var/cache/drive-robust \
    PIP_DISABLE_PIP_VERSION_CHECK=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1
RUN useradd --create-home --uid 1000 driver && mkdir -p /work "$NUMBA_CACHE_DIR" && chown driver /work "$NUMBA_CACHE_DIR"
RUN --mount=type=bind,from=wheels,source=/wheels,target=/wheels pip install -q --no-cache-dir /wheels/*.whl
USER 1000
RUN drive-robust warm && chmod -R a+rwX "$NUMBA_CACHE_DIR"
WORKDIR /work
CMD ["drive-robust", "--help"]
