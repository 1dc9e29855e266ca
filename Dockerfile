# mitsuba_taxel with everything it needs, from this source folder:
#
#   docker build -t taxel .
#   docker run --rm -v "$PWD:/work" taxel render pad.xml -D fz=-10
#
# The folder of the caller is /work; files in it belong to the user 1000 unless --user says otherwise. A graphics card
# is used with `docker run --gpus all -e NVIDIA_DRIVER_CAPABILITIES=compute,graphics,utility taxel --variant cuda_ad_mono`.
FROM python:3.13-slim-trixie AS build
COPY . /source
# Compilers are not needed: every dependency has a wheel for x86-64. On aarch64, pads are meshed from files only.
# The first start of Python links the libraries of LLVM into place, for which a user has no rights later.
RUN python -m venv /opt/taxel && /opt/taxel/bin/pip install --no-cache-dir --only-binary=:all: /source[contact] \
    && /opt/taxel/bin/python -c ""

FROM python:3.13-slim-trixie
# Dr.Jit is linked with libatomic, the only library beyond those of the base; LLVM has a wheel for x86-64 only.
RUN apt-get update && apt-get install --yes --no-install-recommends libatomic1 \
    $([ "$(dpkg --print-architecture)" = amd64 ] || echo libllvm19) \
    && rm -rf /var/lib/apt/lists/* && useradd --uid 1000 --create-home taxel
COPY --from=build /opt/taxel /opt/taxel
USER taxel
WORKDIR /work
RUN ["/opt/taxel/bin/taxel", "doctor"]
ENTRYPOINT ["/opt/taxel/bin/taxel"]
CMD ["--help"]
