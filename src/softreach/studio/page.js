// What viser's page lacks: when fields apply, which keys are the scene's, and letters on dark ground.

// viser drops what a field tells if Enter follows at once; and fields that are left apply too.
(function () {
  function apply(form) {
    form.typed = false;
    setTimeout(function () {
      if (form.isConnected) form.requestSubmit();
    }, 120);
  }
  addEventListener("input", function (event) {
    if (event.target.form) event.target.form.typed = true;
  }, true);
  addEventListener("keydown", function (event) {
    var form = event.target.form;
    if (form && event.key === "Enter") {
      event.preventDefault();
      event.stopPropagation();
      apply(form);
    }
  }, true);
  addEventListener("focusin", function (event) {
    if (event.target.form) event.target.form.before = event.target.value;
  }, true);
  addEventListener("keydown", function (event) {
    var field = event.target;
    if (event.key !== "Escape" || !field.form || field.form.before === undefined) return;
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(
      field, field.form.before);
    field.dispatchEvent(new Event("input", { bubbles: true }));
    field.form.typed = false;
  }, true);
  addEventListener("focusout", function (event) {
    var form = event.target.form;
    if (form && form.typed) apply(form);
  }, true);
})();

// viser turns its camera with every key that is not typed into a field. Keys of a slider, a tab or a
// button are its own, as are arrows where they scroll; those with Ctrl are commands.
document.documentElement.addEventListener("keydown", function (event) {
  var target = event.target, own = target.closest && target.closest("[role=slider], [role=tab], button");
  var scrolls = target.matches && target.matches("[data-scrolls]") && event.key.startsWith("Arrow");
  if ((own || scrolls) && !event.ctrlKey && !event.metaKey) event.stopPropagation();
});

// Ctrl+Z and Ctrl+Shift+Z press the buttons Undo and Redo, but not while one types.
addEventListener("keydown", function (event) {
  if (!(event.ctrlKey || event.metaKey) || event.altKey || event.key.toLowerCase() !== "z") return;
  if (event.target.closest && event.target.closest("input, textarea, select")) return;
  var step = event.shiftKey ? "redo" : "undo", buttons = [...document.querySelectorAll("button")];
  var button = buttons.find(function (each) { return each.textContent.toLowerCase() === step; });
  if (!button) return;
  event.preventDefault();
  button.click();
}, true);

// Screen readers hear the label in front of a control; pictures have the text of their folder. What
// scrolls is reached by keys. `--panel` is how wide the panel is, for tooltips beside it.
(function () {
  function name() {
    var label = "";
    document.querySelectorAll("label, [role=slider], input, button").forEach(function (control) {
      if (control.tagName === "LABEL") label = control.textContent.trim() || label;
      else if (control.getAttribute("aria-label") || control.textContent.trim()) return;
      else if (control.tagName === "BUTTON") control.setAttribute("aria-label", "close");
      else if (label) control.setAttribute("aria-label", label);
    });
    document.querySelectorAll("img").forEach(function (picture) {
      var around = picture.parentElement;
      while (around && !around.textContent.trim()) around = around.parentElement;
      if (around) picture.alt = around.textContent.trim();
    });
  }
  function scroll() {
    document.querySelectorAll("[data-scrollarea-viewport]").forEach(function (area) {
      if (area.querySelector("button, input, a, [tabindex]")) return;
      area.tabIndex = 0;
      area.dataset.scrolls = "";
      area.setAttribute("role", "group");
      area.setAttribute("aria-label", "figures");
    });
  }
  var waiting = false;
  function tidy() {
    waiting = false;
    name();
    scroll();
    var status = document.querySelector("[data-softreach]");
    if (!status) return;
    var panel = innerWidth - status.getBoundingClientRect().left;
    document.documentElement.style.setProperty("--panel", Math.round(panel + 10) + "px");
  }
  new MutationObserver(function () {
    if (!waiting) setTimeout(tidy, 60);
    waiting = true;
  }).observe(document.documentElement, { childList: true, subtree: true });
})();

// Smooth edges cost a third of the pictures a second where no graphics card draws them: there edges are
// plain, and the arm follows a dragged tip.
(function () {
  var plain, context = HTMLCanvasElement.prototype.getContext;
  function isSoftware() {
    var gl = context.call(document.createElement("canvas"), "webgl2");
    if (!gl) return false;
    var names = gl.getExtension("WEBGL_debug_renderer_info"), end = gl.getExtension("WEBGL_lose_context");
    var name = gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
    if (end) end.loseContext();
    return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
  }
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    if (kind === "webgl2" && options && options.antialias) {
      if (plain === undefined) plain = isSoftware();
      options = { ...options, antialias: !plain };
    }
    return context.call(this, kind, options);
  };
})();

// While a node is dragged, viser tells where the mouse is after 50 ms and the picture that follows: 7 to
// 9 times a second. Here it is told at every move, of which browsers make one a picture.
(function () {
  var wait = window.setTimeout, held = false;
  ["pointerdown", "pointerup", "pointercancel"].forEach(function (kind) {
    addEventListener(kind, function (event) {
      held = kind === "pointerdown" && event.target.tagName === "CANVAS";
    }, true);
  });
  window.setTimeout = function (call, delay) {
    if (!held || delay !== 50) return wait.apply(window, arguments);
    queueMicrotask(call);
    return 0;
  };
})();
