// Draws the figures of the page, keeps its link, and tells sizes of files before they are sent.
(function () {
  "use strict";
  // the library of figures is large: the page is there, and the server at work, while the browser reads it
  const library = document.querySelector("script[src*='plotly']");
  const drawing = window.Plotly ? Promise.resolve() : new Promise(function (done, fail) {
    library.addEventListener("load", done);
    library.addEventListener("error", function () { fail(new Error("The library of figures did not load.")); });
  });
  // the legend has as many lines as the width asks for: below the title of the lowest axis there is place for all
  function makePlace(el) {
    const legend = el.querySelector(".legend"), margin = el._fullLayout && el._fullLayout.margin;
    if (!legend || !margin || !el.offsetParent) return;
    const lines = legend.getBoundingClientRect().height, bottom = Math.round(60 + lines);
    if (!lines || Math.abs(margin.b - bottom) < 2) return;
    const height = el.baseHeight + Math.max(0, Math.round(lines - 40));
    el.style.height = height + "px";
    Plotly.relayout(el, { "margin.b": bottom, height: height });
  }
  class Figure extends Shiny.OutputBinding {
    find(scope) {
      return $(scope).find(".gmwm-figure");
    }
    async renderValue(el, message) {
      const state = el.parentElement.querySelector(".gmwm-state");
      el.latest = message;
      if (!message) {
        if (el.placed) Plotly.purge(el); // with what listens to it
        el.placed = false;
        el.removeAttribute("aria-label");
        el.removeAttribute("data-drawn");
        el.style.height = "";
        state.textContent = "";
        return;
      }
      if (message.busy) { // the figure before stays, and is seen to be no answer
        el.classList.add("gmwm-stale");
        el.removeAttribute("data-drawn");
        state.textContent = message.busy;
        return;
      }
      await drawing;
      if (el.latest !== message) return; // another one came while it was waited for
      const figure = JSON.parse(message.figure);
      const layout = figure.layout;
      const alt = (layout.meta && layout.meta.alt) || "";
      el.baseHeight = layout.height;
      el.style.height = layout.height + "px";
      if (el.clientWidth < 560) { // a phone: less margin
        layout.margin = Object.assign({}, layout.margin, { l: 62, r: 6 });
        for (const axis of Object.values(layout)) { // and fewer numbers along it
          if (axis && axis.type === "log" && axis.anchor && axis.anchor[0] === "y" && Number(axis.dtick)) {
            axis.dtick = Math.max(axis.dtick, Math.ceil((axis.range[1] - axis.range[0]) / 5));
          }
        }
      }
      await Plotly.react(el, figure.data, layout, {
        responsive: true, displaylogo: false, toImageButtonOptions: { format: "svg", filename: message.name },
        modeBarButtonsToRemove: ["select2d", "lasso2d"],
      });
      if (!el.placed) {
        el.placed = true;
        el.on("plotly_afterplot", function () { makePlace(el); });
      }
      makePlace(el);
      el.setAttribute("role", "img");
      el.setAttribute("aria-label", alt);
      el.classList.remove("gmwm-stale");
      state.textContent = "";
      el.dataset.drawn = String(Number(el.dataset.count || 0) + 1);
      el.dataset.count = el.dataset.drawn;
    }
    renderError(el, error) {
      el.parentElement.querySelector(".gmwm-state").textContent = error.message;
    }
    clearError() {}
  }
  Shiny.outputBindings.register(new Figure(), "gmwm.figure");

  Shiny.addCustomMessageHandler("gmwm-link", function (message) {
    const query = message.query;
    history.replaceState(null, "", location.pathname + (query ? "?" + query : ""));
  });

  // long work: how far it has come
  Shiny.addCustomMessageHandler("gmwm-job", function (message) {
    const place = document.getElementById("job"), bar = document.getElementById("job_bar");
    place.hidden = !message.job;
    if (!message.job) return;
    document.getElementById("job_text").textContent = message.job.text;
    if (message.job.total && message.job.done) {
      bar.max = message.job.total;
      bar.value = message.job.done;
    } else {
      bar.removeAttribute("value"); // nobody knows
    }
  });

  const narrow = matchMedia("(max-width: 560px)");
  function tell() { Shiny.setInputValue("narrow", narrow.matches); }
  narrow.addEventListener("change", tell);
  $(document).on("shiny:connected", tell);

  // the framework shows the name of a file in a field that has none itself
  $(document).on("shiny:connected", function () {
    document.querySelectorAll(".shiny-input-container input[readonly]").forEach(function (el) {
      el.setAttribute("aria-label", "the file that was chosen");
    });
  });

  // a model of the table of fits is taken up again
  document.addEventListener("click", function (event) {
    const button = event.target.closest("[data-take]");
    if (button) Shiny.setInputValue("take", button.dataset.take, { priority: "event" });
  });

  // values from the clipboard, which are no message that the server would refuse
  document.addEventListener("click", function (event) {
    const button = event.target.closest("[data-paste]");
    if (!button) return;
    const field = document.querySelector(".gmwm-pasted"), told = document.getElementById("too_long");
    const most = Number(button.dataset.most);
    told.textContent = field.value.length > most
      ? "These are " + field.value.length + " characters, and at most " + most + " are taken: send more as a file." : "";
    if (!told.textContent) Shiny.setInputValue(button.dataset.paste, field.value, { priority: "event" });
  });

  // before the framework's own listener
  document.addEventListener("change", function (event) {
    const field = event.target;
    if (field.type !== "file" || !field.files.length) return;
    const most = Number(document.body.querySelector("[data-max-upload]").dataset.maxUpload);
    const told = document.getElementById("too_large");
    told.textContent = "";
    if (field.files[0].size > most) {
      event.stopImmediatePropagation();
      told.textContent = told.dataset.sentence;
      field.value = "";
    }
  }, true);

  // a figure that was drawn while it was hidden takes the width that it has now
  document.addEventListener("shown.bs.tab", function () {
    document.querySelectorAll(".gmwm-figure[data-drawn]").forEach(function (el) {
      if (el.offsetParent) Plotly.Plots.resize(el);
    });
  });
})();
