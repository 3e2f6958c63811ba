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

// Keys of the page, in one table: how a key is written, what it does, and what is done here.
(function () {
  var keys = [
    ["1 \u2026 8", "choose a tab", /^[1-8]$/, chooseTab],
    ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo"],
    ["F", "the scene alone, with its key and numbers; F or Esc ends that"],
    ["Enter, Esc in a field", "apply what is typed, restore what was there"],
    ["W A S D, Q E, arrows", "move the camera"],
    ["?", "show this table, or hide it", /^\?$/, toggleTable],
  ];

  function chooseTab(key) {
    var lists = [...document.querySelectorAll("[role=tablist]")].map(function (list) {
      return list.querySelectorAll("[role=tab]");
    });
    lists.sort(function (one, other) { return other.length - one.length; });
    var enter = new KeyboardEvent("keydown", { key: "Enter", bubbles: true }); // to a click it is deaf
    if (lists[0] && lists[0][key - 1]) lists[0][key - 1].dispatchEvent(enter);
  }

  function press(step) {
    var buttons = [...document.querySelectorAll("button")];
    var button = buttons.find(function (each) { return each.textContent.toLowerCase() === step; });
    if (!button) return;
    button.disabled = false; // it may be gray still of the step before; the server knows
    button.click();
  }

  function toggleTable() {
    var table = document.querySelector("dialog.keys") || tableOfKeys();
    if (table.open) table.close();
    else table.showModal();
  }

  function tableOfKeys() {
    var dialog = document.createElement("dialog"), table = document.createElement("table");
    dialog.className = "keys";
    dialog.setAttribute("aria-label", "keys");
    keys.forEach(function (key) {
      var row = table.insertRow();
      row.insertCell().textContent = key[0];
      row.insertCell().textContent = key[1];
    });
    dialog.append(table);
    dialog.addEventListener("click", function () { dialog.close(); });
    return document.body.appendChild(dialog);
  }

  addEventListener("keydown", function (event) {
    if (!document.querySelector("[data-history]")) return; // a page that was saved has no tabs
    if (event.target.closest && event.target.closest("input, textarea, select")) return;
    var command = event.ctrlKey || event.metaKey;
    if (command && !event.altKey && event.key.toLowerCase() === "z") {
      event.preventDefault();
      press(event.shiftKey ? "redo" : "undo");
    }
    if (command || event.altKey || event.target.closest("[role=slider]")) return;
    keys.forEach(function (key) {
      if (!key[2] || !key[2].test(event.key)) return;
      event.preventDefault();
      event.stopPropagation();
      key[3](event.key);
    });
  }, true);
})();

// What changes with the page: names of controls, which steps can be undone, how wide the panel is.
(function () {
  // Readers of screens hear the label in front of a control; buttons that are pictures get words.
  function name() {
    var label = "";
    document.querySelectorAll("label, [role=slider], input, button").forEach(function (control) {
      if (control.tagName === "LABEL") label = control.textContent.trim() || label;
      else if (control.getAttribute("aria-label") || control.textContent.trim()) return;
      else if (control.tagName === "BUTTON") {
        control.setAttribute("aria-label", "close");
      } else if (label) control.setAttribute("aria-label", label);
    });
    document.querySelectorAll("img").forEach(function (picture) {
      var around = picture.parentElement; // its folder, whose text says what is seen
      while (around && !around.textContent.trim()) around = around.parentElement;
      if (around) picture.alt = around.textContent.trim();
    });
  }
  // What scrolls is reached by keys: by those of a control in it, or by its own.
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
    var status = document.querySelector("[data-history]");
    if (!status) return;
    var steps = status.dataset.history;
    document.querySelectorAll("button").forEach(function (button) {
      var step = button.textContent.toLowerCase();
      if (step === "undo" || step === "redo") button.disabled = !steps.includes(step);
    });
    var panel = innerWidth - status.getBoundingClientRect().left;
    document.documentElement.style.setProperty("--panel", Math.round(panel + 10) + "px");
  }
  new MutationObserver(function () {
    if (!waiting) setTimeout(tidy, 60);
    waiting = true;
  }).observe(document.documentElement, { childList: true, subtree: true });
})();

// viser writes black on white whatever the page looks like; its two shaders for that get a switch.
(function () {
  var gl = window.WebGL2RenderingContext && WebGL2RenderingContext.prototype;
  if (!gl) return;
  var source = gl.shaderSource, attach = gl.attachShader, use = gl.useProgram;
  var shaders = new WeakSet(), programs = new WeakMap();
  gl.shaderSource = function (shader, text) {
    var ours = text
      .replace("vec4(1.0, 1.0, 1.0, 0.85 * vAlpha)",
               "vec4(vec3(1.0 - 0.92 * isDark), 0.85 * vAlpha)")
      .replace("vec4(0.0, 0.0, 0.0, a)", "vec4(vec3(0.85 * isDark), a)");
    if (ours !== text) {
      shaders.add(shader);
      ours = ours.replace("void main", "uniform float isDark; void main");
    }
    source.call(this, shader, ours);
  };
  gl.attachShader = function (program, shader) {
    if (shaders.has(shader)) programs.set(program, null);
    attach.call(this, program, shader);
  };
  gl.useProgram = function (program) {
    use.call(this, program);
    if (!program || !programs.has(program)) return;
    var place = programs.get(program) || this.getUniformLocation(program, "isDark");
    programs.set(program, place);
    this.uniform1f(place, document.documentElement.dataset.mantineColorScheme === "dark" ? 1 : 0);
  };
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

// While a node is dragged, viser tells where the mouse is after 50 ms and the picture that follows. Here
// it is told at every move, of which browsers make one a picture.
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

// Presentation: F hides the panel and leaves the scene, its key and its numbers; F or Escape ends it.
(function () {
  var root = document.documentElement;
  addEventListener("keydown", function (event) {
    var at = event.target, presenting = "presenting" in root.dataset;
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    if (at.isContentEditable || /^(INPUT|TEXTAREA|SELECT)$/.test(at.tagName)) return;
    if (event.key === "Escape" || event.key.toLowerCase() === "f" && presenting) {
      delete root.dataset.presenting;
    } else if (event.key.toLowerCase() === "f") {
      if (at.blur) at.blur();  // what is hidden hears no more keys
      root.dataset.presenting = "";
    }
  }, true);
})();

// The arm of a fresh page sweeps its reach, unless less motion is wanted; whatever a person does ends it.
(function () {
  function say(motion) {
    try { localStorage.setItem("viser-user:softreach-motion", motion); } catch (_) {}
  }
  say(matchMedia("(prefers-reduced-motion: reduce)").matches ? "" : "welcome");
  ["keydown", "pointerdown", "wheel"].forEach(function (kind) {
    addEventListener(kind, function () { say(""); }, { capture: true, passive: true });
  });
})();
