# Ligature with ROS 1 on Debian 12. Build the wheel first: make wheel && docker build -t ligature .
FROM debian:12-slim

RUN apt-get update && apt-get install -y --no-install-recommends ca-certificates && rm -rf /var/lib/apt/lists/*
COPY debian-packages.txt /tmp/
RUN apt-get update && sed 's/#.*//' /tmp/debian-packages.txt | xargs apt-get install -y --no-install-recommends && rm -rf /var/lib/apt/lists/*

COPY requirements.txt /tmp/
COPY dist/ligature_sim-*.whl /tmp/
RUN python3 -m venv --system-site-packages /opt/ligature
RUN /opt/ligature/bin/pip install --no-cache-dir -r /tmp/requirements.txt
RUN /opt/ligature/bin/pip install --no-cache-dir --no-deps /tmp/ligature_sim-*.whl

RUN useradd --create-home ligature
USER ligature
WORKDIR /home/ligature
ENV PATH=/opt/ligature/bin:/usr/bin:/bin
RUN ligature compile

ENTRYPOINT ["ligature"]
CMD ["--help"]
