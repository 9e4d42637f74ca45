# syntax=docker/dockerfile:1

# --- dependencies: a layer of their own, rebuilt only when a manifest or the lock file changes
FROM rust:1.95.0-slim-bookworm AS build
WORKDIR /src
COPY Cargo.toml Cargo.lock rust-toolchain.toml ./
COPY crates/budget/Cargo.toml crates/budget/
COPY crates/contract/Cargo.toml crates/contract/
COPY crates/geometry/Cargo.toml crates/geometry/
COPY crates/gltf-scan/Cargo.toml crates/gltf-scan/
COPY crates/jobs/Cargo.toml crates/jobs/
COPY crates/json/Cargo.toml crates/json/
COPY crates/lab/Cargo.toml crates/lab/
COPY crates/mend/Cargo.toml crates/mend/
COPY crates/mesh-files/Cargo.toml crates/mesh-files/
COPY crates/net/Cargo.toml crates/net/
COPY crates/render/Cargo.toml crates/render/
COPY crates/serve/Cargo.toml crates/serve/
COPY crates/texture/Cargo.toml crates/texture/
COPY scripts/stub-sources scripts/
RUN scripts/stub-sources && cargo build --release --locked --bin darn && cargo clean --release --workspace

# --- build: everything the binary is made of, and nothing of the tests
COPY proto proto
COPY weights weights
COPY examples examples
COPY web/dist web/dist
COPY crates crates
COPY src src
# What `GET /info` calls the commit: docker build --build-arg DARN_COMMIT=$(git rev-parse HEAD)
ARG DARN_COMMIT
RUN cargo build --release --locked --bin darn

# --- run: the binary with its weights built in, glibc, and a user that is not root
FROM gcr.io/distroless/cc-debian12:nonroot
COPY --from=build /src/target/release/darn /usr/local/bin/darn
# Other machines can reach it: it starts with DARN_KEYS, or with DARN_ALLOW_ANONYMOUS=true, and with neither says so and ends (README, Working on it).
ENV DARN_LISTEN=0.0.0.0:8080
# distroless's nonroot, by number so that an orchestrator can check it.
USER 65532:65532
EXPOSE 8080
# Asks /readyz at DARN_LISTEN, which says yes once the warm-up mend is done.
HEALTHCHECK --interval=10s --timeout=3s --start-period=60s --retries=3 CMD ["/usr/local/bin/darn", "healthcheck"]
ENTRYPOINT ["/usr/local/bin/darn"]
CMD ["serve"]
