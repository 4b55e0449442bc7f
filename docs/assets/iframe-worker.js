// A browser starts no worker of a page that was opened from the disk; the search runs in a hidden frame there instead.
// Material's plugin `offline` would load such a script from elsewhere; one whose name has "iframe-worker" replaces it.
if (location.protocol === "file:") {
  window.Worker = class extends EventTarget {
    constructor(url) {
      super();
      this.early = [];
      this.frame = document.createElement("iframe");
      this.frame.hidden = true;
      document.body.append(this.frame);
      const inside = this.frame.contentWindow;
      inside.IFrameWorker = true; // the search asks for it to find its own path
      inside.postMessage = (data) => this.dispatchEvent(new MessageEvent("message", { data }));
      inside.importScripts = async (...sources) => {
        for (const source of sources) await this.load(source);
      };
      this.load(url).then(() => {
        const early = this.early;
        this.early = null;
        early.forEach((data) => this.postMessage(data));
      });
    }

    load(source) {
      return new Promise((loaded, failed) => {
        const script = this.frame.contentDocument.createElement("script");
        script.src = new URL(source, location.href);
        script.onload = loaded;
        script.onerror = failed;
        this.frame.contentDocument.body.append(script);
      });
    }

    postMessage(data) {
      if (this.early) this.early.push(data);
      else this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data }));
    }

    terminate() {
      this.frame.remove();
    }
  };
}
