# syntax=docker/dockerfile:1

# --- build: everything the binary is made of, and nothing of the tests
FROM rust:1.95.0-slim-bookworm AS build
WORKDIR /src
COPY Cargo.toml Cargo.lock build.rs ./
COPY proto proto
COPY weights weights
COPY examples examples
COPY src src
RUN cargo build --release --locked --bin darn

# --- run: the binary with its weights built in, glibc, and a user that is not root
FROM gcr.io/distroless/cc-debian12:nonroot
COPY --from=build /src/target/release/darn /usr/local/bin/darn
ENV DARN_LISTEN=0.0.0.0:8080
# distroless's nonroot, by number so that an orchestrator can check it.
USER 65532:65532
EXPOSE 8080
# Asks /readyz at DARN_LISTEN, which says yes once the warm-up mend is done.
HEALTHCHECK --interval=10s --timeout=3s --start-period=60s --retries=3 CMD ["/usr/local/bin/darn", "healthcheck"]
ENTRYPOINT ["/usr/local/bin/darn"]
CMD ["serve"]
