// Search runs in a worker, which browsers refuse to pages that are opened from the disk: there a hidden frame does its
// work. It takes the place of https://unpkg.com/iframe-worker, so that nothing comes from the network.
if (location.protocol === "file:") {
  window.IFrameWorker = window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      const frame = document.createElement("iframe");
      frame.hidden = true;
      document.body.append(frame);
      this.inside = frame.contentWindow;
      this.loaded = new Promise((resolve) => { this.inside.started = resolve; });
      this.inside.postMessage = (data) => {
        const message = new MessageEvent("message", { data });
        this.dispatchEvent(message);
        if (this.onmessage) this.onmessage(message);
      };
      this.inside.importScripts = (...urls) => Promise.all(urls.map((script) => this.load(script)));
      this.load(url).then(() => this.inside.started());
    }

    load(url) {
      const script = this.inside.document.createElement("script");
      script.src = new URL(url, location.href);
      this.inside.document.body.append(script);
      return new Promise((resolve, reject) => { script.onload = resolve; script.onerror = reject; });
    }

    postMessage(data) {
      this.loaded.then(() => this.inside.dispatchEvent(new MessageEvent("message", { data })));
    }

    terminate() {}
  };
}
