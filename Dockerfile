# Genu in a container: the command and the module for Python.
#   docker build -t genu . && docker run --rm -v "$PWD:/data" genu phantom S192803-phantom knee --build
FROM rust:1.90-bookworm AS build
RUN apt-get update \
    && apt-get install -y --no-install-recommends python3-pip python3-venv \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /genu
COPY . .
RUN python3 -m venv /maturin \
    && /maturin/bin/pip install --no-cache-dir "maturin>=1.9,<2" \
    && /maturin/bin/maturin build --release --locked -m python/Cargo.toml -o /wheels

FROM python:3.12-slim-bookworm
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir "$(ls /wheels/*.whl)[all]" \
    && rm -r /wheels \
    && useradd --create-home knee
USER knee
WORKDIR /data
ENTRYPOINT ["build-model"]
CMD ["--help"]
